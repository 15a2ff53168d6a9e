ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
n = DiscreteRange(1, 6)
other = new Object at (5 * n, 12)
require n in [2, 5]
