ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5, with viewAngle 110 deg, with visibleDistance 20
area = RectangularRegion((5, 0), 0, 60, 60)
new Object in not visible area, with requireVisible False
