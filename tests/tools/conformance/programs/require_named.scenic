ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
other = new Object at (Range(5, 30), 9)
require other.position.x > 20 as far_enough
