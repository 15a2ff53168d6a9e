# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at ego.position + Vector(3, 9) * 2 - Vector(1, 1)
