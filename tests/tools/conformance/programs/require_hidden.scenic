ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
gap = Range(0, 20)
other = new Object ahead of ego by gap
require gap > 5 and gap < 7 or gap > 18
