ego = new Object at (3, -4)
other = new Object at (20, 5), facing 30 deg, with headingStdDev 0
mutate other
