ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
area = CircularRegion((30, 10), 5).union(RectangularRegion((50, 10), 0, 4, 8))
new Object in area
