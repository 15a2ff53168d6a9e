# sharp: position
model scenic.domains.driving.model
ego = Car on network.lanes[0]
Car following roadDirection for Range(8, 9), with requireVisible False
