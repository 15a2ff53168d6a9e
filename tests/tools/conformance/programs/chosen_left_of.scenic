# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
a = new Object at (20, 0), facing 20 deg, with width 2
b = new Object at (30, 9), facing 50 deg, with width 3
chosen = Uniform(a, b)
new Object left of chosen by 3, with width 2
