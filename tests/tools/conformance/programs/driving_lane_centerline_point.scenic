# sharp: position heading
model scenic.domains.driving.model
lane = Uniform(*network.lanes)
spot = new OrientedPoint on lane.centerline
ego = new Car at spot
new Car ahead of ego by 5
