# sharp: heading
model scenic.domains.driving.model
ego = new Car
spot = new OrientedPoint on network.lanes[0]
new Car following roadDirection from spot for 12
