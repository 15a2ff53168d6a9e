# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
x = Range(10, 30)
new Object at (x, 20)
new Object at (2 * x + 9, 40 - x)
