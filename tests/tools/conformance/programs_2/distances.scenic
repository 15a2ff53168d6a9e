# sharp: position heading
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
a = Object at 20 @ 8
Object at (distance to a) @ (distance from a to 3 @ 30)
require (distance from a to ego) > 3
