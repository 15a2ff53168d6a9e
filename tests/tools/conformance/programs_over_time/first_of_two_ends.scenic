model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=9)
start = new Point at ego.position
terminate when (distance from ego to start) > 25
terminate after 4 seconds
