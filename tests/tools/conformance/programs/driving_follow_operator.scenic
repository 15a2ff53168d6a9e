# sharp: position heading
model scenic.domains.driving.model
ego = new Car on network.lanes[0]
spot = follow roadDirection from ego for 12
new Car at spot, facing spot.heading
