# sharp: heading
model scenic.domains.driving.model
lane = network.lanes[0]
ego = new Car on lane, facing lane.orientation
