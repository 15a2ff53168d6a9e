# sharp: position heading
ego = new Object at (3, -4), facing -150 deg, with width 2, with length 5
new Object ahead of ego, with width 0.6, with length 2.9
