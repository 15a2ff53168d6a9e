ego = new Object at (3, -4)
other = new Object at (Range(20, 25), 5), facing 30 deg, with requireVisible False
mutate other by 2
