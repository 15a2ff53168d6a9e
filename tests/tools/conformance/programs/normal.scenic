ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at (Normal(20, 3), Normal(5, 2)), facing Normal(0, 0.2)
