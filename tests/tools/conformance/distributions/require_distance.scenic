ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
other = new Object at (Range(-20, 30), Range(-30, 20)), facing Normal(0, 1), with requireVisible False
require 9 < (distance to other) < 18
