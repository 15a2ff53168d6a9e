ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
other = new Object at (Range(-30, 30), Range(10, 40))
require 15 < (distance to other) < 25 and abs(relative heading of other) > 10 deg
