ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
other = new Object at (Range(-9, 9), Range(-9, 9)), with width 4, with length 3, facing Range(0, 360) deg
