# sharp: heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
line = PolylineRegion([(20, 0), (30, 5), (30, 20)])
new Object on CircularRegion((26, 3), 2), facing line.orientation
