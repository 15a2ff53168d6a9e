ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at (Discrete({20: 1, 30: 2, Range(40, 50): 5}), Options({13: 3, 17: 1})), with requireVisible False
