model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=8)
start = new Point at ego.position
require next (distance from ego to start) < 5
require always ((distance from ego to start) < 2 implies ((next ego.speed < 8) or ego.speed > 7))
terminate after 3 seconds
