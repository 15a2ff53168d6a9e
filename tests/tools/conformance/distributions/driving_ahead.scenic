model scenic.domains.driving.model
ego = new Car
new Car ahead of ego by Range(4, 20), facing Normal(0, 0.2) relative to roadDirection
require (distance to intersection) < 30
