# sharp: heading
model scenic.domains.driving.model
ego = new Car on road
new Car on road, facing 5 deg relative to roadDirection
