model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=7)
other = new Car ahead of ego by 35
require (distance to intersection) > 70
require always ego can see other
require always other in road
terminate when (distance to other) < 20
