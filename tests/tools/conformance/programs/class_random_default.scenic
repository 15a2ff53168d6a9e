class Box:
    width: Range(1, 3)
    length: self.width + 1

ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Box left of ego by 1
