model scenic.domains.driving.model
lane = Uniform(*network.lanes)
spot = new OrientedPoint on lane.centerline
ego = new Car left of spot by 0.1, with regionContainedIn None
