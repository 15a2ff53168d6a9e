model scenic.domains.driving.model
behavior Walk(speed):
    take SetWalkingDirectionAction(self.heading), SetWalkingSpeedAction(speed)
ego = new Car
first = new Pedestrian ahead of ego by 6, with regionContainedIn None, with behavior Walk(1)
second = new Pedestrian ahead of first by 2, with regionContainedIn None, with behavior Walk(2)
require (distance to intersection) > 40
require always (distance from ego to first) < (distance from ego to second)
terminate when (distance from first to second) > 8
