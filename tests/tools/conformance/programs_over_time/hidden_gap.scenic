# hidden: the gap
model scenic.domains.driving.model
gap = Range(8, 14)
ego = new Car with behavior FollowLaneBehavior(target_speed=7)
other = new Car ahead of ego by 25
require (distance to intersection) > 60
terminate when (distance to other) < gap
