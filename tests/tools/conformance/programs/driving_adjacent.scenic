model scenic.domains.driving.model
ego = new Car on Uniform(*[s for s in network.laneSections if s._laneToLeft is not None])
new Car on road
