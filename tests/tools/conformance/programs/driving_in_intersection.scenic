model scenic.domains.driving.model
ego = new Car on intersection
new Car on ego.intersection
