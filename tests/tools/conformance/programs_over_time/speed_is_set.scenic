model scenic.domains.driving.model
ego = new Car with speed 6, with behavior FollowLaneBehavior(target_speed=6)
other = new Car ahead of ego by 15, with speed Range(3, 5), with behavior FollowLaneBehavior(target_speed=8)
require (distance to intersection) > 80
require always other.speed > 1
terminate when other.speed > 7
