ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at (TruncatedNormal(20, 3, 19, 26), TruncatedNormal(5, 4, 12, 14)), with requireVisible False
