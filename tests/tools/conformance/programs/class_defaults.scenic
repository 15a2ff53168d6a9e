# sharp: position heading
class Box:
    width: 2
    length: self.width * 2
    position: Vector(20, 3 + self.width)
    heading: 30 deg

ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Box with width 3
