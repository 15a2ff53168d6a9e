model scenic.domains.driving.model
ego = new Car at network.lanes[3].centerline[1]
if ego._lane is not None:
    new Car on road
