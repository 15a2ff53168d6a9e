# sharp: heading
model scenic.domains.driving.model
ego = new Car
new Car facing Range(-5, 5) deg relative to roadDirection
