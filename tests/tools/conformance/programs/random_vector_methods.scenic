ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
v = Vector(Range(10, 20), 4)
new Object at v.rotatedBy(90 deg) + Vector(30, 0), with width v.x / 9, with length v.norm() / 9
