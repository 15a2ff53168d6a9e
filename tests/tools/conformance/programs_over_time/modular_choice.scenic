model scenic.domains.driving.model
behavior Ends(speed):
    do FollowLaneBehavior(target_speed=speed) for 3 seconds
    terminate
scenario First():
    other = new Car ahead of ego by 12, with behavior Ends(6)
scenario Last():
    third = new Car behind ego by 12, with behavior Ends(7)
scenario Main():
    setup:
        ego = new Car with behavior FollowLaneBehavior(target_speed=8)
        require (distance from ego to intersection) > 80
    compose:
        do choose First(), Last()
        terminate
