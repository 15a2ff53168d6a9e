# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object left of (20, 5) by 2, with width 3, facing 30 deg
