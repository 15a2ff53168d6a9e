model scenic.domains.driving.model
ego = new Car with visibleDistance 30
new Car visible
