# sharp: position heading
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
Object at 20 @ 8, apparently facing 30 deg
Object at 30 @ 12, apparently facing 30 deg from 5 @ 40
