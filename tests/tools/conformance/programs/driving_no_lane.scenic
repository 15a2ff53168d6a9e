model scenic.domains.driving.model
ego = new Pedestrian
new Car
require ego._lane is None
