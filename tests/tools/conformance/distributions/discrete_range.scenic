ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at (DiscreteRange(5, 9) * 4, 15), facing DiscreteRange(-2, 2) * 10 deg, with requireVisible False
