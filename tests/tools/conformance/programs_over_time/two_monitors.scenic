model scenic.domains.driving.model
monitor Ends(limit=6):
    while ego.speed < limit:
        wait
    terminate
monitor Near():
    while True:
        require (distance to other) < 30
        wait
ego = new Car with behavior FollowLaneBehavior(target_speed=8)
other = new Car ahead of ego by 12, with behavior FollowLaneBehavior(target_speed=8)
require (distance to intersection) > 80
require monitor Ends()
require monitor Near()
