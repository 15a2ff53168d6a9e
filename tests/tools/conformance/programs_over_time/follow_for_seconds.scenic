model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=8)
require always ego.speed < 12
terminate after 5 seconds
