# sharp: heading
model scenic.domains.driving.model
ego = new Car with roadDeviation Range(10, 20) deg
