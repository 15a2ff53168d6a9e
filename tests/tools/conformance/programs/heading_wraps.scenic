# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at (20, 3), facing 350 deg
new Object at (40, 3), facing -190 deg
