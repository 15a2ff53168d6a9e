ego = new Object at (3, -4)
other = new Object at (20, 5), facing 30 deg
mutate
require (distance to other) > 1
