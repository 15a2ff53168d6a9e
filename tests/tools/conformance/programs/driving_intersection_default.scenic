model scenic.domains.driving.model
ego = new Car in intersection
