model scenic.domains.driving.model
ego = new Car with visibleDistance 40
other = new Car
require ego can see other
