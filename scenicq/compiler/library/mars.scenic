# The field of rubble of the 2019 paper's figure 5: five metres wide, with the classes of Scenic's example.

workspace = Workspace(RectangularRegion((0, 0), 0, 5, 5))

class Goal:
    width: 0.3
    length: 0.3

class Rover:
    width: 0.5
    length: 0.7

class _Debris:
    position: new Point in workspace
    heading: Range(0, 360) deg

class BigRock(_Debris):
    width: 0.17
    length: 0.17

class Rock(_Debris):
    width: 0.1
    length: 0.1

class Pipe(_Debris):
    width: 0.2
    length: Range(0.5, 1.5)
