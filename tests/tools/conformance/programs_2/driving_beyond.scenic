# sharp: position
model scenic.domains.driving.model
ego = Car
other = Car ahead of (front of ego) by 5
Pedestrian beyond other by 4, with regionContainedIn None
