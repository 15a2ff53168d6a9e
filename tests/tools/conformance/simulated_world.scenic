"""The world of traffic in Scenic's Newtonian simulator, with the classes and behaviors that programs for CARLA name."""

from scenic.simulators.newtonian.driving_model import *
from scenic.domains.driving.actions import Steers, Walks

param weather = 'ClearNoon'
param carla_map = 'map'
param timestep = 0.1


class _Steered(Vehicle, Steers):
    blueprint: None

    def setVelocity(self, velocity):
        self.velocity = Vector(*velocity)

    @property
    def isCar(self):
        return True


class Car(Car):
    blueprint: None

    def setVelocity(self, velocity):
        self.velocity = Vector(*velocity)


class NPCCar(Car):
    pass


class Bicycle(_Steered):
    width: 1
    length: 2


class Motorcycle(_Steered):
    width: 1
    length: 2


class Truck(_Steered):
    width: 2.5
    length: 7.5


class Van(_Steered):
    width: 2
    length: 5


class Bus(_Steered):
    width: 4
    length: 10


class Pedestrian(Pedestrian):
    blueprint: None
    width: 0.5
    length: 0.5


class Prop(NewtonianActor):
    regionContainedIn: road
    position: new Point on road
    parentOrientation: Range(0, 360) deg
    width: 0.5
    length: 0.5
    blueprint: None
    physics: False


class Trash(Prop):
    pass


class Cone(Prop):
    pass


class Debris(Prop):
    pass


class VendingMachine(Prop):
    pass


class Barrel(Prop):
    pass


behavior AutopilotBehavior(enabled=True, **kwargs):
    do FollowLaneBehavior()


behavior WalkForwardBehavior(speed=0.5):
    take SetWalkingDirectionAction(self.heading), SetWalkingSpeedAction(speed)


behavior WalkBehavior(maxSpeed=1.4):
    take SetWalkingDirectionAction(self.heading), SetWalkingSpeedAction(maxSpeed)


behavior CrossingBehavior(reference_actor, min_speed=1, threshold=10, final_speed=None):
    while (distance from self to reference_actor) > threshold:
        wait
    if isinstance(self, Walks):
        take SetWalkingDirectionAction(self.heading), SetWalkingSpeedAction(min_speed)
    else:
        while True:
            ahead = Vector(0, min_speed).rotatedBy(self.heading)
            take SetVelocityAction(ahead.x, ahead.y)


def freezeTrafficLights():
    pass


def unfreezeTrafficLights():
    pass


def setClosestTrafficLightStatus(vehicle, color, distance=100):
    pass


def setAllIntersectionTrafficLightsStatus(intersection, color):
    pass


def withinDistanceToRedYellowTrafficLight(vehicle, thresholdDistance):
    return False


def withinDistanceToTrafficLight(vehicle, thresholdDistance):
    return False


def getClosestTrafficLightStatus(vehicle, distance=100):
    return "green"
