ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5, with viewAngle 90 deg, with visibleDistance 20
new Object at (Range(-25, 25), Range(-25, 25)), with requireVisible True, with width 3, with length 8, with allowCollisions True
