# sharp: position heading
model scenic.domains.driving.model
ego = new Car
spot = new Point at ego offset along roadDirection by (1, 9)
new Car at spot, facing 3 deg relative to roadDirection
