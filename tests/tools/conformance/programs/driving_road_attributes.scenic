# sharp: heading
model scenic.domains.driving.model
road_ = Uniform(*network.roads)
lane = Uniform(*road_.lanes)
ego = new Car on lane, facing 0.1 relative to roadDirection
