model scenic.domains.driving.model
ego = new Car
other = new Car on road
require network.laneAt(ego offset by (0, 5)) is other._lane
