model scenic.domains.driving.model
ego = new Car on Uniform(*network.roads)
spot = new OrientedPoint on ego.laneGroup.curb
new Car left of spot by 0.5
