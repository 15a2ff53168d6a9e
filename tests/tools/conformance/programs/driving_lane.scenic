# sharp: heading
model scenic.domains.driving.model
lane = Uniform(*network.lanes)
ego = new Car on lane
