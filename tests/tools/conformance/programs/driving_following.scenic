# sharp: position heading
model scenic.domains.driving.model
ego = new Car on network.lanes[0]
new Car following roadDirection for Range(8, 9)
