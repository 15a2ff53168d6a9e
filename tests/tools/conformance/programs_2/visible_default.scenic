ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5, with visibleDistance 20, with viewAngle 90 deg
Object at Range(-20, 30) @ Range(-20, 30)
