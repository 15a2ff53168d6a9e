ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object in SectorRegion(Vector(30, 10), 12, -150 deg, 300 deg)
