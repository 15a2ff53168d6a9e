model scenic.domains.driving.model
monitor Limits(car, other):
    while car.speed < 4:
        require (distance from car to other) > 15
        wait
    while (distance from car to other) > 12:
        require car.speed > 3
        wait
    terminate
ego = new Car with behavior FollowLaneBehavior(target_speed=7)
other = new Car ahead of ego by 30
require (distance to intersection) > 60
require monitor Limits(ego, other)
