model scenic.domains.driving.model
behavior Cross():
    while (distance from self to ego) > 15:
        wait
    while True:
        take SetWalkingDirectionAction(self.heading), SetWalkingSpeedAction(2)
behavior DriveAndWait():
    try:
        do FollowLaneBehavior(target_speed=7)
    interrupt when (distance from self to walker) < 12:
        take SetBrakeAction(1)
ego = new Car with behavior DriveAndWait()
spot = new OrientedPoint ahead of ego by 25
walker = new Pedestrian right of spot by 4, facing 90 deg relative to spot.heading, with regionContainedIn None, with behavior Cross()
require (distance to intersection) > 60
require always (distance to walker) > 2.5
require eventually (distance from walker to spot) < 1
terminate when (distance from walker to spot) > 4.5 and (distance to walker) < 14
