# What Scenic's model for the CARLA simulator has otherwise than its driving domain.

class Pedestrian(Pedestrian):
    width: 0.5
    length: 0.5
