# sharp: position heading
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
spot = OrientedPoint at 14 @ 9, facing 70 deg
Object at spot offset by 2 @ 3, facing spot.heading
