# scenic refuses
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
Object at 20 @ 5, left of ego
