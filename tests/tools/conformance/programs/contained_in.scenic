ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
area = CircularRegion((30, 10), 8)
new Object contained in area, with width 3, with length 4
