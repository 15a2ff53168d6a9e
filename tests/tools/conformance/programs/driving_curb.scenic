model scenic.domains.driving.model
ego = new Car
spot = new OrientedPoint on curb
new Car left of spot by 0.5, facing 10 deg relative to roadDirection
