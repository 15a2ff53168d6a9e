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

# what behaviors ask about the objects of the program

def withinDistanceToAnyCars(car, thresholdDistance):
    return any([(distance from car to other) < thresholdDistance for other in simulation().objects
                if other is not car and isinstance(other, Vehicle)])

def withinDistanceToAnyPedestrians(vehicle, thresholdDistance):
    return any([(vehicle can see other) and (distance from other to front of vehicle) < thresholdDistance
                for other in simulation().objects if other is not vehicle and isinstance(other, Pedestrian)])

# who is nearer than 0.1 m is taken for the vehicle itself
def _isWithin(vehicle, other, thresholdDistance):
    return (vehicle can see other) and 0.1 <= (distance from vehicle.position to other.position) < thresholdDistance

def withinDistanceToAnyObjs(vehicle, thresholdDistance):
    return any([_isWithin(vehicle, other, thresholdDistance) for other in simulation().objects if other is not vehicle])

def _isOnSameLane(vehicle, other):
    crossing = network.intersectionAt(vehicle)
    if crossing:
        return crossing == network.intersectionAt(other)
    return network.laneAt(vehicle) == network.laneAt(other)

def withinDistanceToObjsInLane(vehicle, thresholdDistance):
    return any([_isWithin(vehicle, other, thresholdDistance) and _isOnSameLane(vehicle, other)
                for other in simulation().objects if other is not vehicle])
