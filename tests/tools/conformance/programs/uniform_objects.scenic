# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
a = new Object at (20, 0), facing 20 deg
b = new Object at (30, 0), facing 50 deg
chosen = Uniform(a, b)
new Object at chosen offset by (0, 10)
