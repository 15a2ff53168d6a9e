ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5, with viewAngle 90 deg, with visibleDistance 30
other = new Object at (Range(-30, 30), Range(-30, 30)), with allowCollisions True
require not (ego can see other.position)
