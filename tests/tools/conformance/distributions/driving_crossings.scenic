model scenic.domains.driving.model
crossing = Uniform(*filter(lambda i: i.is3Way, network.intersections))
ego = new Car on Uniform(*crossing.incomingLanes).centerline, with regionContainedIn None
new Car on Uniform(*crossing.maneuvers).connectingLane, with regionContainedIn None, with allowCollisions True
