model scenic.domains.driving.model
ego = new Car with speed 5, with behavior FollowLaneBehavior(target_speed=8)
require always abs(ego.velocity.x) < 14 and abs(ego.velocity.y) < 14
require eventually abs(ego.velocity.x) + abs(ego.velocity.y) > 6
terminate after 4 seconds
