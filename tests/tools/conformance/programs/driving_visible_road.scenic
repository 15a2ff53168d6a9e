# sharp: heading
model scenic.domains.driving.model
ego = new Car with visibleDistance 30
new Car on visible road
