ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
size = Range(1, 3)
new Object at (Uniform(size, Normal(10, size), 30) + 12, Range(0, size) * 3), with width size, with requireVisible False, with allowCollisions True
