model scenic.domains.driving.model
monitor Watch():
    while True:
        if ego.speed > 6:
            terminate
        elif ego.speed > 3:
            require (distance from ego to other) > 6
        else:
            require (distance from ego to other) > 10
        wait
ego = new Car with behavior FollowLaneBehavior(target_speed=7)
other = new Car ahead of ego by 30
require (distance to intersection) > 60
require monitor Watch()
terminate after 10 seconds
