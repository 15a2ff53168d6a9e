# sharp: position heading
model scenic.domains.driving.model
ego = new Car
new Car left of ego by 0.5, facing 170 deg relative to ego.heading
