ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
area = CircularRegion((30, 10), 9).difference(RectangularRegion((30, 10), 0, 4, 8))
new Object in area, with requireVisible False
new Object on SectorRegion(Vector(-30, 10), 12, 30 deg, 100 deg), with requireVisible False
new Object on PolylineRegion([(20, -40), (30, -35), (30, -20)]), with requireVisible False
