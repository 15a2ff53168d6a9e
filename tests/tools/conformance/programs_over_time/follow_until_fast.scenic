model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=8)
require (distance to intersection) > 60
terminate when ego.speed > 7
