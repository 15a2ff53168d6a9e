# sharp: position heading
model scenic.domains.driving.model
ego = new Car
other = new Car ahead of ego by 5
new Pedestrian beyond other by 4, with regionContainedIn None
