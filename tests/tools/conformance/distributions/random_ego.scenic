ego = new Object at (Normal(0, 5), Range(0, 9)), facing Normal(0, 1)
new Object beyond (20, 30) by Range(2, 9), facing toward ego, with requireVisible False
