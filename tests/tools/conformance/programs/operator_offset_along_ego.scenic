# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at ego offset along 30 deg by (2, 25)
