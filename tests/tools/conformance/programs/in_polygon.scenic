ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object in PolygonalRegion([(20, 0), (40, 0), (30, 5), (40, 20), (20, 20)])
