model scenic.domains.driving.model
ego = new Car with regionContainedIn None
new Car ahead of ego by 5, with regionContainedIn None, with allowCollisions True
mutate
