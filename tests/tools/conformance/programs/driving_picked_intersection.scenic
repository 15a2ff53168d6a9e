model scenic.domains.driving.model
crossing = Uniform(*network.intersections)
ego = new Car on crossing, facing Range(0, 360) deg
new Car on Uniform(*crossing.incomingLanes)
