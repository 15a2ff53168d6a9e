model scenic.domains.driving.model
ego = new Car
other = new Car on road
require ego.road is other.road
