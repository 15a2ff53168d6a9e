model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=6)
require (distance to intersection) > 40
require always ego in road
require always (ego.lane is not None)
terminate after 4 seconds
