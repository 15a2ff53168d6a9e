ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
a = new OrientedPoint at (-10, 20), facing 180 deg, with viewAngle 60 deg
b = new OrientedPoint at (20, 20), facing 180 deg, with viewAngle 60 deg
viewer = Uniform(a, b)
other = new Object at (Range(-20, 30), Range(-12, 15)), with allowCollisions True
require viewer can see other
