# hidden: the distance, which the initial scene has, too
model scenic.domains.driving.model
d = Range(10, 20)
ego = new Car with behavior FollowLaneBehavior(target_speed=7)
other = new Car ahead of ego by d
require (distance to intersection) > 60
require always (distance to other) < d + 6
terminate when (distance to other) < d + 1
