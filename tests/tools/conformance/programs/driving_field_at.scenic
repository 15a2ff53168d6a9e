model scenic.domains.driving.model
ego = new Car
spot = new Point on road
new Car at spot, facing (roadDirection at spot) + 20 deg
