model scenic.domains.driving.model
ego = new Car with behavior FollowLaneBehavior(target_speed=6)
other = new Car ahead of ego by (-3.5, 40), facing 180 deg relative to ego.heading, with behavior FollowLaneBehavior(target_speed=6)
require (distance to intersection) > 80
require always abs(relative heading of other from ego) > 90 deg
require eventually (distance to other) < 8
terminate when (angle from ego to other) - ego.heading > 90 deg and (distance to other) < 12
