# sharp: heading
model scenic.domains.driving.model
ego = new Car
new Pedestrian left of ego by Range(2, 5), facing Range(-10, 10) deg relative to ego.heading, with regionContainedIn None
