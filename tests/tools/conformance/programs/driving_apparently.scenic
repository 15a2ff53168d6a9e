model scenic.domains.driving.model
ego = new Car
new Car offset by (Range(-5, 5), Range(8, 12)), apparently facing 90 deg, with regionContainedIn None
