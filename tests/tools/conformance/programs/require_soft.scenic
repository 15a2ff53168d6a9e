ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
other = new Object at (Range(-30, -10), Range(10, 40))
require[0.5] other.position.x > -15
