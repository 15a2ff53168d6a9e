# sharp: heading
model scenic.domains.driving.model
ego = new Car
new Car offset by (Range(-2, 2), Range(6, 10)), facing 10 deg relative to roadDirection
