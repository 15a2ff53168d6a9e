# Classes of objects on roads, with the default properties of Scenic's driving domain.

class DrivingObject:
    requireVisible: False

class Vehicle(DrivingObject):
    regionContainedIn: roadOrShoulder
    position: new Point on road
    heading: (roadDirection at self.position) + self.roadDeviation
    roadDeviation: 0
    viewAngle: 90 deg
    width: 2
    length: 4.5

class Car(Vehicle):
    pass

class NPCCar(Car):
    pass

class Pedestrian(DrivingObject):
    regionContainedIn: network.walkableRegion
    position: new Point on network.walkableRegion
    heading: Range(0, 360) deg
    viewAngle: 90 deg
    width: 0.75
    length: 0.75
