# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5, with visibleDistance 20
new Object at (Range(9, 10), 5), visible, facing 3 deg
