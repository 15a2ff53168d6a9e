# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at (TruncatedNormal(20, 3, 19, 20), TruncatedNormal(5, 2, 5, 6))
