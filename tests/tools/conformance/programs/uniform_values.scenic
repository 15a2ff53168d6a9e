# sharp: heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at Uniform((20, 5), (30, 7), (44, 1))
