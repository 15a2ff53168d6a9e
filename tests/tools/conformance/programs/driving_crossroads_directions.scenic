model scenic.domains.driving.model
crossing = network.intersections[0]
ego = new Car on Uniform(*crossing.maneuvers).connectingLane
new Car on Uniform(*crossing.maneuvers).connectingLane.centerline, with allowCollisions True
