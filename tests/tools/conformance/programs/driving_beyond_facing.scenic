# sharp: heading
model scenic.domains.driving.model
ego = new Car
other = new Car ahead of ego by 3, with regionContainedIn None
new Car beyond other by (Range(-1, 1), 9), facing roadDirection
