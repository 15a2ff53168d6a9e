ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object on SectorRegion(Vector(30, 10), 12, 30 deg, 100 deg), facing Range(0, 360) deg
