# sharp: position heading
class Turned:
    heading: self.turn + 10 deg
    turn: 5 deg

ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Turned at (20, 3), with turn 20 deg
