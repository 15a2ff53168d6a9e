# sharp: position heading
class Turned:
    heading: 30 deg

ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Turned at (20, 3)
new Turned ahead of ego by 9
