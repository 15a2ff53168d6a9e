ego = new Object at (3, -4)
other = new Object at (20, 5)
mutate other
