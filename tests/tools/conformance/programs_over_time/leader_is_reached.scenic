model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=9)
leader = new Car ahead of ego by 20, with behavior FollowLaneBehavior(target_speed=3)
require (distance to intersection) > 80
require eventually (distance to leader) < 15
require always (distance to leader) > 5
terminate when (distance to leader) < 12
