model scenic.domains.driving.model
ego = new Car
other = new Car ahead of ego by 3, with regionContainedIn None
new Car beyond other by (Range(-2, 2), 9), with regionContainedIn None, with allowCollisions True
