model scenic.domains.driving.model
lane = Uniform(*network.lanes)
spot = new OrientedPoint on lane
ego = new Car at spot
new Pedestrian right of spot by 4, with regionContainedIn None
