model scenic.domains.driving.model
behavior DriveThenBrake():
    do FollowLaneBehavior(target_speed=8) for 3 seconds
    while True:
        take SetThrottleAction(0), SetBrakeAction(0.6)
ego = new Car with behavior DriveThenBrake()
require always (ego.speed > 5 implies (eventually ego.speed < 1))
terminate after 8 seconds
