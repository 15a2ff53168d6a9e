# sharp: heading
model scenic.domains.driving.model
ego = new Car
new Car on road, facing (roadDirection relative to 10 deg)
