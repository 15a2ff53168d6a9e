model scenic.domains.driving.model
lane = Uniform(*network.lanes)
ego = new Car on lane.centerline
new Car on lane.sectionAt(ego)
