model scenic.domains.driving.model
behavior Slow():
    do FollowLaneBehavior(target_speed=3)
scenario Beside(gap):
    setup:
        other = new Car ahead of ego by gap, with behavior FollowLaneBehavior(target_speed=6)
scenario Slower():
    setup:
        override ego with behavior Slow()
        require always ego.speed < 12
        terminate after 3 seconds
scenario Main():
    setup:
        ego = new Car with behavior FollowLaneBehavior(target_speed=8)
        require (distance from ego to intersection) > 80
    compose:
        do Beside(15) until ego.speed > 5
        do Slower()
        wait for 1 seconds
        terminate
