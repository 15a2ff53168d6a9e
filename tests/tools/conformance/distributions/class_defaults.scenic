ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
class Box:
    width: Range(1, 3)
    length: self.width * Normal(2, 0.1)
    heading: self.width * 20 deg
new Box at (20, 20), with requireVisible False
