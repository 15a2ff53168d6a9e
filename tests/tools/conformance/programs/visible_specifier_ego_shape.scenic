ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5, with visibleDistance 9, with viewAngle 360 deg
new Object visible, facing Range(0, 90) deg
