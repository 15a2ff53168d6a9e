# sharp: position heading
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
Object behind 20 @ 5 by 2, with length 4, facing 50 deg
