model scenic.domains.driving.model
lane = Uniform(*network.lanes)
ego = new Car on lane, with regionContainedIn None
new Pedestrian left of ego by TruncatedNormal(2, 1, 1, 5), with regionContainedIn None
