# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
turn = Range(10, 20) deg
first = new Object at (20, 8), facing turn
new Object at (40, 8), facing turn relative to first.heading
