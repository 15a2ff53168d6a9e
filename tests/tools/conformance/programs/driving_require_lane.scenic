model scenic.domains.driving.model
lane = network.lanes[4]
ego = new Car
other = new Car on road
require other in lane or (distance from other to lane) < 60
