model scenic.domains.driving.model
ego = new Car with width 3, with length 8
