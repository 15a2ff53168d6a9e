ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at (Range(10, 30), Range(5, 20)), facing toward (0, 0)
