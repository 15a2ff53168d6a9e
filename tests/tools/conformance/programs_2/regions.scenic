ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
area = CircularRegion(20 @ 10, 9).difference(RectangularRegion(20 @ 10, 0, 4, 8))
Object in area, facing Range(0, 360) deg
