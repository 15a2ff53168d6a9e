model scenic.domains.driving.model
ego = new Car
new Car on ego.oppositeLaneGroup
