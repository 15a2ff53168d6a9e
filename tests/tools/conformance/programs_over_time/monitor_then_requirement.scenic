model scenic.domains.driving.model
monitor Stops():
    while ego.speed < 4:
        wait
    while ego.speed > 0.5:
        wait
    terminate
behavior DriveThenBrake():
    do FollowLaneBehavior(target_speed=7) for 4 seconds
    while True:
        take SetThrottleAction(0), SetBrakeAction(0.8)
ego = new Car with behavior DriveThenBrake()
require always ego.speed < 9
require eventually (ego.speed > 4 and (next ego.speed > 4))
require monitor Stops()
