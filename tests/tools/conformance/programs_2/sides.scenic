# differs: Scenic 2.1.0 measures from the centre of the other object, its manual and the paper from its edge
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
a = Object left of ego by 3, with width 2
Object ahead of a by Range(1, 2), with length 3, facing 10 deg
