# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object offset by (0, 10), facing 10 deg
