model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=6)
other = new Car ahead of ego by 10, with behavior FollowLaneBehavior(target_speed=6)
require (distance to intersection) > 70
require not (eventually (ego.speed > 3 and (distance to other) < 6))
require not (always ego.speed < 1)
terminate after 5 seconds
