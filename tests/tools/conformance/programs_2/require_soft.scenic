ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
other = Object at Range(5, 30) @ 9
require[0.5] other.position.x > 20
require other can see ego or ego can see other
