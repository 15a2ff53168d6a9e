workspace = Workspace(RectangularRegion((0, 0), 0, 80, 80))
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5, with viewAngle 80 deg, with visibleDistance 30
new Object not visible, with requireVisible False
