ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
x = Range(0, 40)
new Object at (x, 20), with requireVisible False
require[0.7] x > 30
