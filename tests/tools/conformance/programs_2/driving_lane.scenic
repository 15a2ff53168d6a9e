# sharp: heading
model scenic.domains.driving.model
lane = Uniform(*network.lanes)
ego = Car on lane
