model scenic.domains.driving.model
spot = new Point on road
ego = new Car on network.laneAt(spot, reject=True)
