# Somebody on foot comes from the right and crosses the ego's course in front of it.
from math import sin
model scenic.domains.driving.model

def to_the_left(thing):
    return (distance from ego to thing) * sin((angle from ego to thing) - ego.heading)

ego = new Car
walker = new Pedestrian

require to_the_left(walker) < -2
require always (distance to walker) < 40
terminate when to_the_left(walker) > 2
