model scenic.domains.driving.model
junction = Uniform(*network.intersections)
lane = Uniform(*junction.incomingLanes)
ego = new Car on Uniform(*lane.maneuvers).connectingLane, with regionContainedIn None
