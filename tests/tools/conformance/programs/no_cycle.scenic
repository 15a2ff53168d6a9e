# scenic refuses
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object left of (3, 4) by 2, facing toward ego
