# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
a = new OrientedPoint at ego offset by (0, 9)
b = new OrientedPoint left of a by 3, facing 20 deg relative to a
new Object ahead of b by 2, with length 2
