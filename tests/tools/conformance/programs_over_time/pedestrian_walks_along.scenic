model scenic.domains.driving.model
behavior Walk():
    take SetWalkingDirectionAction(self.heading), SetWalkingSpeedAction(1.4)
ego = new Car
walker = new Pedestrian left of ego by 3, with regionContainedIn None, with behavior Walk()
start = new Point at walker.position
require always walker.speed < 2
require always ego.speed < 0.1
terminate when (distance from walker to start) > 6
