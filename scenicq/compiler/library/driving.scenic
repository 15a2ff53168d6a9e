# Classes of objects on roads, with the default properties of Scenic's driving domain.

class DrivingObject:
    requireVisible: False
    isVehicle = False
    isPedestrian = False
    isCar = False
    elevation = None

class Vehicle(DrivingObject):
    regionContainedIn: roadOrShoulder
    position: new Point on road
    heading: (roadDirection at self.position) + self.roadDeviation
    roadDeviation: 0
    viewAngle: 90 deg
    width: 2
    length: 4.5
    isVehicle = True
    color = None
    maxSteeringAngle = 35 deg
    wheelDiameter = 0.7
    groundClearance = 0.35
    maxSpeed = 45
    maxAcceleration = 5
    maxDeceleration = 10

class Car(Vehicle):
    isCar = True

class NPCCar(Car):
    pass

class Pedestrian(DrivingObject):
    regionContainedIn: network.walkableRegion
    position: new Point on network.walkableRegion
    heading: Range(0, 360) deg
    viewAngle: 90 deg
    width: 0.75
    length: 0.75
    isPedestrian = True
    color = (0, 0.5, 1)
    mass = 65

# a sensor says what is recorded, not what is there
def SSSensor(*args, **kwargs):
    return None

def RGBSensor(*args, **kwargs):
    return None
