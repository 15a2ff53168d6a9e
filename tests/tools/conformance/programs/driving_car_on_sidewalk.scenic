# sharp: heading
model scenic.domains.driving.model
ego = new Car
new Car on network.sidewalks[3], with regionContainedIn None
