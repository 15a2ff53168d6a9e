# sharp: position heading
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
Object offset by Range(-1, 1) @ 9
