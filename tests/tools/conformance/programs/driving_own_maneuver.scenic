model scenic.domains.driving.model
ego = new Car on Uniform(*Uniform(*network.intersections).incomingLanes)
m = Uniform(*ego.lane.maneuvers)
new Car on m.endLane
