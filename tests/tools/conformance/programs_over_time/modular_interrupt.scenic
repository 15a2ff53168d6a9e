model scenic.domains.driving.model
scenario Lead():
    setup:
        lead = new Car ahead of ego by Range(10, 14), with behavior FollowLaneBehavior(target_speed=5)
scenario Close(limit):
    setup:
        require eventually ego.speed > limit
        terminate after 1 seconds
scenario Main():
    setup:
        ego = new Car with behavior FollowLaneBehavior(target_speed=8)
        require (distance from ego to intersection) > 80
    compose:
        leads = Lead()
        try:
            do leads for 6 seconds
        interrupt when (distance from ego to leads.lead) < 11:
            do Close(0.5)
        terminate
