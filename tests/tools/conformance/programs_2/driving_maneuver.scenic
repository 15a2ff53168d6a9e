model scenic.domains.driving.model
crossing = Uniform(*network.intersections)
lane = Uniform(*crossing.incomingLanes)
maneuver = Uniform(*lane.maneuvers)
ego = Car on lane.centerline
Car on maneuver.connectingLane.centerline
