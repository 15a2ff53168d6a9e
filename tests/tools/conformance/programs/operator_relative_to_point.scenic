# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
spot = new Point at (30, 10)
new Object at (3, 8) relative to spot
