# sharp: heading
model scenic.domains.driving.model
ego = Car
Car on road, facing Range(-5, 5) deg relative to roadDirection
