workspace = Workspace(RectangularRegion((0, 0), 0, 100, 100))
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5, with viewAngle 90 deg
new Object at (Range(-30, 30), Range(-30, 30)), not visible, with requireVisible False, with width 5
