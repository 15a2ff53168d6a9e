# Classes of Scenic's model for roads in the Webots simulator.

modelWithName = {
    "BmwX5": _record("BmwX5", 2, 4.75),
    "CitroenCZero": _record("CitroenCZero", 1.5, 3.5),
    "LincolnMKZ": _record("LincolnMKZ", 1.9, 5),
    "RangeRoverSportSVR": _record("RangeRoverSportSVR", 1.9, 4.5),
    "ToyotaPrius": _record("ToyotaPrius", 1.9, 4.5),
    "Bus": _record("Bus", 3, 10),
    "Truck": _record("Truck", 2.7, 14.5),
    "Tractor": _record("Tractor", 2, 3),
    "MotorBikeSimple": _record("MotorBikeSimple", 1, 2.5),
}
carModels = list(modelWithName.values())
smallVehicles = carModels[:5]
CarModel = _module("CarModel", {}, _record)

class WebotsObject:
    pass

class Vehicle(WebotsObject):
    regionContainedIn: road
    position: new Point on road
    heading: (roadDirection at self.position) + self.roadDeviation
    roadDeviation: 0
    viewAngle: 90 deg
    width: 1.9
    length: 4.5
    cameraOffset: Vector(0, self.length / 2)

class Car(Vehicle):
    pass

class SmallCar(Car):
    pass

class BmwX5(Car):
    width: 2
    length: 4.75

class CitroenCZero(Car):
    width: 1.5
    length: 3.5

class LincolnMKZ(Car):
    length: 5

class RangeRoverSportSVR(Car):
    pass

class ToyotaPrius(Car):
    pass

class Bus(Vehicle):
    width: 3
    length: 10

class Truck(Vehicle):
    width: 2.7
    length: 14.5

class Tractor(Vehicle):
    width: 2
    length: 3

class Motorcycle(Vehicle):
    width: 1
    length: 2.5

class Pedestrian(WebotsObject):
    regionContainedIn: walkway
    position: new Point on walkway
    heading: Range(0, 360) deg
    width: 0.5
    length: 0.5

class OilBarrel(WebotsObject):
    width: 0.61
    length: 0.61

class SolidBox(WebotsObject):
    width: 2
    length: 2

class TrafficCone(WebotsObject):
    width: 0.5
    length: 0.5

class Cone(TrafficCone):
    pass

class WorkBarrier(WebotsObject):
    width: 1.2
    length: 0.4
