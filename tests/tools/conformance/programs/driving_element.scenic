model scenic.domains.driving.model
ego = new Car
require ego._element is not None
