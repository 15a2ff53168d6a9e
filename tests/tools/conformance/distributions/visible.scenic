ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5, with viewAngle 80 deg, with visibleDistance 20
new Object visible, facing Normal(0, 1)
new Object at (Range(-30, 30), Range(-30, 30)), with requireVisible True, with allowCollisions True
