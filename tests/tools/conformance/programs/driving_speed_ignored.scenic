# sharp: position heading
model scenic.domains.driving.model
ego = new Car with speed 3
new Car ahead of ego by 5, with regionContainedIn None
