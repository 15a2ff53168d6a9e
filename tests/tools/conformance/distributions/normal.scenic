ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at (Normal(30, 3), Normal(25, 2)), facing Normal(0, 0.2), with requireVisible False
