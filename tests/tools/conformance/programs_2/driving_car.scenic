# sharp: heading
model scenic.domains.driving.model
ego = Car
