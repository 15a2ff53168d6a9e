# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
spot = new OrientedPoint at (20, 5), facing -50 deg
new Object left of spot by 2, with width 3
