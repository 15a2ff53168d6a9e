# Classes of Scenic's model for the LGSVL simulator.

class EgoCar(Car):
    pass

class ApolloCar(EgoCar):
    pass

class Bus(Vehicle):
    pass

class Waypoint(OrientedPoint):
    heading: roadDirection at self.position
    speed: 10
