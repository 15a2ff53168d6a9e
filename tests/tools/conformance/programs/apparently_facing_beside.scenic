ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object ahead of ego by 7, apparently facing 30 deg
