model scenic.domains.driving.model
behavior Turn():
    do FollowLaneBehavior(target_speed=6) for 3 seconds
    while True:
        take SetThrottleAction(0.2), SetSteerAction(0.3)
ego = new Car with behavior Turn()
start = new OrientedPoint at ego.position, facing ego.heading
require (distance to intersection) > 40
require always abs(relative heading of ego from start) < 60 deg
require eventually abs(relative heading of ego from start) > 10 deg
terminate when abs(relative heading of ego from start) > 12 deg
