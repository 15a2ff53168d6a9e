ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
def good(thing):
    return thing.position.x > 20 or thing.position.x < 8
other = new Object at (Range(5, 30), 9)
require good(other)
