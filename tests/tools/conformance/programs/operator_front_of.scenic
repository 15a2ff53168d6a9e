# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at (front of ego) offset by (0, 6)
