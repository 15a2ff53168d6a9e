# sharp: position heading
model scenic.domains.driving.model
ego = new Car
new Car offset along roadDirection by (0, Range(8, 9))
