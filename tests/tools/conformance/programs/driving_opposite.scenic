# sharp: heading
model scenic.domains.driving.model
lane = Uniform(*network.laneGroups)
ego = new Car on network.roads[0].forwardLanes
new Car on network.roads[0].backwardLanes
