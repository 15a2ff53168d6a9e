# sharp: position heading
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
Object at 3 @ 9 relative to ego, facing 10 deg relative to ego.heading
