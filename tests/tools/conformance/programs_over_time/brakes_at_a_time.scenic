model scenic.domains.driving.model
behavior DriveThenBrake():
    do FollowLaneBehavior(target_speed=8) for 3 seconds
    while True:
        take SetThrottleAction(0), SetBrakeAction(1)
ego = new Car with behavior DriveThenBrake()
require eventually ego.speed > 4
require (ego.speed < 4) until (ego.speed > 3)
terminate after 7 seconds
