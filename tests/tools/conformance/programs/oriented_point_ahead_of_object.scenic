# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
a = new OrientedPoint ahead of ego by 6
new Object at a, facing a
