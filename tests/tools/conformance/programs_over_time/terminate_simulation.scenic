model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=7)
terminate simulation when ego.speed > 5
