model scenic.domains.driving.model
behavior Follow():
    try:
        do FollowLaneBehavior(target_speed=7)
    interrupt when (distance from self to leader) < 14:
        take SetBrakeAction(1)
ego = new Car with behavior Follow()
leader = new Car ahead of ego by 25
require (distance to intersection) > 60
require always (distance to leader) > 4.5
require eventually ego.speed > 4
require always (leader.speed < 0.1)
terminate when ego.speed < 0.1 and (distance to leader) < 15
