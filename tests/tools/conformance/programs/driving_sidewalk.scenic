# sharp: heading
model scenic.domains.driving.model
ego = new Car
new Pedestrian on sidewalk
