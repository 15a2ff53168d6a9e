# differs: Scenic 3.1.1 cuts the outer part of a view wider than 120 degrees
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5, with viewAngle 200 deg, with visibleDistance 20
area = RectangularRegion((-11, -17), 0, 1, 1)
new Object in not visible area, with requireVisible False
