# sharp: position heading
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
tree = Object at 14 @ 9
Object beyond tree by Range(2, 3)
