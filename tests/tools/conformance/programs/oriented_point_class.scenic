# sharp: position heading
class Spot(OrientedPoint):
    heading: 45 deg

ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
spot = new Spot at (30, 30)
new Object at spot offset by (1, 2), facing spot
