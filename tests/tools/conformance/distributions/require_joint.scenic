ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
a = Normal(0, 4)
b = Range(-9, 9)
new Object at (20 + a, 20 + b), with requireVisible False
require a * b > 2 or b > 7
