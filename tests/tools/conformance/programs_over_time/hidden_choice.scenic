# hidden: the limit
model scenic.domains.driving.model
limit = Uniform(3, 5, 7)
ego = new Car with behavior FollowLaneBehavior(target_speed=8)
terminate when ego.speed > limit
