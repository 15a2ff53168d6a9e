ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
spot = new Point at (30, 20), with visibleDistance 12
new Object visible from spot, with requireVisible False
