model scenic.domains.driving.model
ego = new Car
other = new Car on road
require ego.lane is not other.lane
