# sharp: heading
model scenic.domains.driving.model
ego = new Car on shoulder, with regionContainedIn None
