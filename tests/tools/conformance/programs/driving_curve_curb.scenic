model scenic.domains.driving.model
ego = new Car with regionContainedIn None
spot = new OrientedPoint on curb
new Car left of spot by 0.5, with regionContainedIn None
