ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
x = Normal(20, 3)
y = resample(x)
new Object at (x, y), facing (x - y) * 5 deg, with requireVisible False
