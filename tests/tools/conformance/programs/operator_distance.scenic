ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
other = new Object at (20, 8)
new Object at (30, 20), with width (distance to other) / 10, with length (distance from (0, 0) to other) / 10
