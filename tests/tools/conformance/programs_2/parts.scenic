# sharp: position heading
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
Object at front left of ego, with allowCollisions True, facing 5 deg
Object ahead of (back right of ego) by 9
