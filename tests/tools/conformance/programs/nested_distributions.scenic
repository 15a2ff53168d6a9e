ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
low = Range(10, 12)
new Object at (Range(low, 14), Uniform(Range(20, 30), Normal(50, 1)))
