model scenic.domains.driving.model
behavior Drive():
    do FollowLaneBehavior(target_speed=5) until (distance from self to ego) > 16
    terminate
ego = new Car
other = new Car ahead of ego by 6, with behavior Drive()
require (distance to intersection) > 60
require always ego.speed < 1
require eventually other.speed > 2
