# sharp: heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object on PolylineRegion([(20, 0), (30, 5), (30, 20)])
