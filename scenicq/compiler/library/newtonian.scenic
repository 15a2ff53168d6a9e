# Classes of Scenic's model for the Newtonian simulator.

class Debris:
    position: new Point on road
    heading: Range(0, 360) deg
