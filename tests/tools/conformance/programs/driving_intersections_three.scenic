model scenic.domains.driving.model
crossing = Uniform(*[c for c in network.intersections if c.is3Way])
ego = new Car on Uniform(*crossing.incomingLanes)
