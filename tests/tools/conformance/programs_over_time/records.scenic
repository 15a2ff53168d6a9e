model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=7)
record ego.speed as speed
record final ego.position as place
terminate when ego.speed > 4
