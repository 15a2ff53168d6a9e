# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
other = new Object at (20, 8), facing 200 deg
new Object at (30, 20), facing relative heading of other
