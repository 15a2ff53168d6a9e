# Further classes, with the default properties of Scenic's model for the CARLA simulator.

class Truck(Vehicle):
    width: 3
    length: 7

class Bus(Vehicle):
    width: 3
    length: 12

class Van(Vehicle):
    pass

class Motorcycle(Vehicle):
    width: 1
    length: 2

class Bicycle(Vehicle):
    width: 1
    length: 2

class Trailer(Vehicle):
    width: 3
    length: 10

class Prop(DrivingObject):
    regionContainedIn: road
    position: new Point on road
    heading: Range(0, 360) deg
    width: 0.5
    length: 0.5

class Cone(Prop):
    pass

class TrafficCone(Cone):
    pass

class Barrier(Prop):
    pass

class Debris(Prop):
    pass

class Trash(Prop):
    pass

class Animal(DrivingObject):
    regionContainedIn: everywhere
    position: new Point on road
    heading: Range(0, 360) deg
