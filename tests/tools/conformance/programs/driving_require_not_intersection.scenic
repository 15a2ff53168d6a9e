model scenic.domains.driving.model
ego = new Car
require not (ego in intersection)
require (distance from ego to intersection) < 30
