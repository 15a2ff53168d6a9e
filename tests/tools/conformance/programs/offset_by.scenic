# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object offset by (Range(2, 3), 8), with length 2
