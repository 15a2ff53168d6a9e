model scenic.domains.driving.model
ego = new Car
other = new Car on visible road
require abs(relative heading of other) > 150 deg and (distance to other) < 40
