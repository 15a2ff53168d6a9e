# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object in PointSetRegion('posts', [(20, 0), (30, 5), (40, 12), (24, 40)])
