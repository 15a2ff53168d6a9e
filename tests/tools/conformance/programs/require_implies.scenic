ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
side = Uniform(-1, 1)
other = new Object at (side * 10 + 5, Range(10, 40))
require (side == 1) implies (other.position.y > 30)
