model scenic.domains.driving.model
ego = new Car
new Car on shoulder, facing Range(0, 360) deg, with regionContainedIn None
