ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
line = PolylineRegion([0 @ 0, 20 @ 10, 20 @ 40])
Object on line, with requireVisible False
require (distance to 0 @ 0) < 99
