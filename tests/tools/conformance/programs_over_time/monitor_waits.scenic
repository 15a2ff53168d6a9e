model scenic.domains.driving.model
monitor Fast(car, limit):
    while car.speed < limit:
        wait
    terminate
ego = new Car with behavior FollowLaneBehavior(target_speed=8)
require monitor Fast(ego, 5)
