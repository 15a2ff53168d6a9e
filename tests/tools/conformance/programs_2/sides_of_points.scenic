# sharp: position heading
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
spot = OrientedPoint at 20 @ 5, facing -50 deg
a = Object left of spot by 2, with width 3
b = Object right of (OrientedPoint at 9 @ 30, facing 20 deg) by 2 @ 1, with width 1.5
Object ahead of spot by Range(1, 2), with length 3, facing 10 deg
