model scenic.domains.driving.model
ego = new Car
spot = new OrientedPoint following roadDirection from ego for 20
new Car at spot, facing 5 deg relative to roadDirection
