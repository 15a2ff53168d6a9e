# hidden: the limit
model scenic.domains.driving.model
limit = Range(7, 12)
ego = new Car with behavior FollowLaneBehavior(target_speed=6)
require always ego.speed < limit
require eventually ego.speed > limit - 6
terminate after 6 seconds
