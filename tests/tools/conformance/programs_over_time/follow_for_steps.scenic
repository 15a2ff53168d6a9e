model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=6)
require eventually ego.speed > 2
terminate after 60 steps
