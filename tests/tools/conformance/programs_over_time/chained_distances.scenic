model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=5)
second = new Car ahead of ego by 8, with behavior FollowLaneBehavior(target_speed=5.5)
third = new Car ahead of second by 8, with behavior FollowLaneBehavior(target_speed=6)
require (distance to intersection) > 100
require always (distance from ego to third) > (distance from ego to second)
require always (distance from second to third) > 6
terminate when (distance from ego to third) > 30
