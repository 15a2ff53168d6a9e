# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
v = Vector(3, 4)
new Object at Vector(20, v.norm()), facing v.angleTo(Vector(0, 9))
assert v.distanceTo(Vector(3, 5)) == 1
