model scenic.domains.driving.model
ego = new Car on Uniform(*network.intersections).incomingLanes[0]
m = Uniform(*ego.lane.maneuvers)
new Car on m.endLane
