# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object behind ego by 1, with length 6, with width 2
