ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
area = CircularRegion((30, 10), 9).intersect(RectangularRegion((36, 10), 0, 9, 8))
new Object in area
