ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
area = CircularRegion((0, 0), 12)
other = new Object at (Range(-20, 20), Range(-20, 20)), with width 4, with allowCollisions True
require other in area
