ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
Object at Range(10, 20) @ Range(-3, 3), facing Range(-20, 20) deg
