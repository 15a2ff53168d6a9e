model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=8)
require 10 < (distance to intersection) < 20
terminate when (distance to intersection) > 25
