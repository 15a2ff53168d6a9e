ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
a = Range(-3, 3)
b = Range(1, 5)
new Object at (20 + a * b, 20 + max(a, b) + hypot(a, b) / 2), facing (a * a) * 10 deg, with requireVisible False
