# sharp: position heading
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
Object offset along 20 deg by 1 @ Range(5, 6)
