model scenic.domains.driving.model
scenario Lead(gap, speed=8):
    setup:
        lead = new Car ahead of ego by gap, with behavior FollowLaneBehavior(target_speed=speed)
        require always (distance from ego to lead) < 60
scenario Limit(most):
    setup:
        require always ego.speed < most
        require eventually ego.speed > 1
scenario Main():
    setup:
        ego = new Car with behavior FollowLaneBehavior(target_speed=8)
        require (distance from ego to intersection) > 80
        terminate after 8 seconds
    compose:
        do Lead(12), Limit(15)
