model scenic.domains.driving.model
ego = new Car
spot = new OrientedPoint on road
new Car at spot offset by (0, 3), facing spot
