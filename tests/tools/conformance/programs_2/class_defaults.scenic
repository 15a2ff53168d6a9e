# sharp: position heading
class Box:
    width: Range(1, 3)
    length: self.width * 2
    heading: 30 deg

ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
Box at 20 @ 3, with width 3
