# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at (20, 8), facing 30 deg relative to ego.heading
