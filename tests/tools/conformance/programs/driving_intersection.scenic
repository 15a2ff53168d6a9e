model scenic.domains.driving.model
ego = new Car in intersection, facing Range(0, 360) deg, with regionContainedIn None
new Car on road
