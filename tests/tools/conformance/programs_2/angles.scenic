# sharp: position heading
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
a = Object at 20 @ 8, facing angle to 30 @ 40
Object at 9 @ 30, facing (angle from a to ego) + (apparent heading of a from 3 @ 3) - (relative heading of a)
