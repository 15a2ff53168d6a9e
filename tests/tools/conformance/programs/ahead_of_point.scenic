# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
spot = new Point at (20, 5)
new Object ahead of spot by 2, with length 3, facing 30 deg
