# sharp: heading
model scenic.domains.driving.model
ego = new Car contained in network.lanes[0]
