# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
spot = new OrientedPoint at (2, 20), facing 70 deg
new Object beyond (10, 10) by 5 from spot
