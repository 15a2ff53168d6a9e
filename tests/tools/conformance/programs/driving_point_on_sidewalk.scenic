model scenic.domains.driving.model
ego = new Car with regionContainedIn None
p1 = new OrientedPoint on sidewalk
new Pedestrian behind p1 by 2, with regionContainedIn None
