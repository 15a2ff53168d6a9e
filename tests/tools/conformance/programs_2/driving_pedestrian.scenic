model scenic.domains.driving.model
ego = Car
Pedestrian
Pedestrian left of (left of ego) by Range(2, 5), with regionContainedIn None
