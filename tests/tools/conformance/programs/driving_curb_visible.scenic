model scenic.domains.driving.model
ego = new Car
spot = new OrientedPoint on visible curb
new Car left of spot by 0.25
