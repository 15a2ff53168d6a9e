ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at (Range(-4, 9), Range(-9, 3)), with width 3, with length 3, facing Range(0, 360) deg, with requireVisible False
