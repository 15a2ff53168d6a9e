# sharp: heading
model scenic.domains.driving.model
ego = new Car
new Pedestrian offset by (Range(3, 5), Range(3, 9)), facing toward ego, with regionContainedIn None
