model scenic.domains.driving.model
behavior Drive():
    do FollowLaneBehavior(target_speed=7) for 4 seconds
    terminate
ego = new Car with behavior Drive()
require always ego.speed < 10
