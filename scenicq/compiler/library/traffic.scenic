# Further road users and props, with the default sizes of Scenic's model for the CARLA simulator where a blueprint
# has none on record; and what datasets have labels of besides, so that a class that a dataset lists can be written.

class Truck(Vehicle):
    width: 2.5
    length: 7.5

class Van(Vehicle):
    length: 5

class Bus(Vehicle):
    width: 4
    length: 10

class Motorcycle(Vehicle):
    width: 1
    length: 2

class Bicycle(Vehicle):
    width: 1
    length: 2

class Trailer(Vehicle):
    width: 3
    length: 10

class ConstructionVehicle(Vehicle):
    width: 2.5
    length: 7

class EmergencyVehicle(Vehicle):
    pass

class Ambulance(EmergencyVehicle):
    length: 6

class PoliceCar(EmergencyVehicle):
    pass

class FireEngine(EmergencyVehicle):
    width: 2.5
    length: 8

class Adult(Pedestrian):
    pass

class Child(Pedestrian):
    pass

class ConstructionWorker(Pedestrian):
    pass

class PoliceOfficer(Pedestrian):
    pass

class PersonalMobility(Pedestrian):
    pass

class Wheelchair(Pedestrian):
    pass

class Stroller(Pedestrian):
    pass

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

class PropDebris(Debris):
    pass

class Trash(Prop):
    pass

class Garbage(Trash):
    pass

class PushablePullable(Prop):
    pass

class BicycleRack(Prop):
    width: 2
    length: 2

class VendingMachine(Prop):
    pass

class Chair(Prop):
    pass

class BusStop(Prop):
    pass

class Advertisement(Prop):
    pass

class Container(Prop):
    pass

class Table(Prop):
    pass

class PlantPot(Prop):
    pass

class Mailbox(Prop):
    pass

class Gnome(Prop):
    pass

class CreasedBox(Prop):
    pass

class Case(Prop):
    pass

class Box(Prop):
    pass

class Bench(Prop):
    pass

class Barrel(Prop):
    pass

class ATM(Prop):
    pass

class Kiosk(Prop):
    pass

class IronPlate(Prop):
    pass

class TrafficWarning(Prop):
    pass

class Animal(DrivingObject):
    regionContainedIn: everywhere
    position: new Point on road
    heading: Range(0, 360) deg
