# sharp: heading
model scenic.domains.driving.model
ego = new Car on network.laneRegion
