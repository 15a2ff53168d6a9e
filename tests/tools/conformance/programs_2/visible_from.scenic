ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
spot = OrientedPoint at 24 @ 20, facing 120 deg, with viewAngle 60 deg, with visibleDistance 12
Object visible from spot, with requireVisible False
