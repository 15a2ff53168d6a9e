# sharp: position heading
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
a = Object at 20 @ 8, facing toward ego
Object at 30 @ 12, facing toward a
