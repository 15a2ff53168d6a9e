# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
tree = new Object at (14, 9)
new Object beyond tree by (2, 3)
