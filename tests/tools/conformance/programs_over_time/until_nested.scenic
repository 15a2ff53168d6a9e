model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=8)
other = new Car ahead of ego by 30
require (distance to intersection) > 60
require (ego.speed < 7) until ((distance to other) < 25 until (distance to other) < 15)
terminate when (distance to other) < 14
