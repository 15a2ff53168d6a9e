model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=6)
leader = new Car ahead of ego by 12, with behavior FollowLaneBehavior(target_speed=8)
require (distance to intersection) > 80
require always (distance to leader) > 10
terminate when (distance to leader) > 18
