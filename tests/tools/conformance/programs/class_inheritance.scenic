# sharp: position heading
class Box:
    width: 2
    length: 3

class LongBox(Box):
    length: Range(6, 7)

ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new LongBox ahead of ego by 2
