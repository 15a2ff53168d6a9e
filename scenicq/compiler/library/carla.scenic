# What Scenic's model for the CARLA simulator has otherwise than its driving domain.

class Pedestrian(Pedestrian):
    width: 0.5
    length: 0.5

# no label says how a traffic light stands, and what a program sets changes none

def freezeTrafficLights():
    pass

def unfreezeTrafficLights():
    pass

def setAllIntersectionTrafficLightsStatus(intersection, color):
    pass

def setTrafficLightStatus(signal, color):
    pass

def setClosestTrafficLightStatus(vehicle, color, distance=100):
    pass

def getTrafficLightStatus(signal):
    return _unknown(f"the light {signal}")

def getClosestTrafficLightStatus(vehicle, distance=100):
    return _unknown("the closest light", vehicle, distance)

def withinDistanceToTrafficLight(vehicle, thresholdDistance):
    return _unknown("a light", vehicle, thresholdDistance) == "near"

def withinDistanceToRedYellowTrafficLight(vehicle, thresholdDistance):
    return _unknown("a red or yellow light", vehicle, thresholdDistance) == "near"
