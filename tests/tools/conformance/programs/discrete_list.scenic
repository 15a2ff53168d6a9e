# sharp: heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at (Discrete([20, 30, 40]), 3)
