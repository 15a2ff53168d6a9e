model scenic.domains.driving.model
crossing = Uniform(*network.intersections)
lane = Uniform(*crossing.incomingLanes)
maneuver = Uniform(*lane.maneuvers)
ego = new Car on lane.centerline
new Car on maneuver.connectingLane.centerline
