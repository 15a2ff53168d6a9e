ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at (Range(20, 40), Range(0, 20)), with regionContainedIn CircularRegion((30, 10), 8), with length 5
