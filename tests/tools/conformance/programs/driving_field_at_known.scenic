# sharp: position heading
model scenic.domains.driving.model
ego = new Car on network.lanes[0]
new Pedestrian offset by (3, 6), facing (roadDirection at ego) + 20 deg, with regionContainedIn None
