# sharp: heading
model scenic.domains.driving.model
ego = new Car on network.roads[3].forwardLanes
new Car on network.roads[3].forwardLanes.opposite
