model scenic.domains.driving.model
# differs: Scenic 3.1.1 takes the apparent heading relative to the inherited orientation
ego = new Car
new Car offset by (Range(-5, 5), Range(8, 12)), apparently facing 90 deg, with regionContainedIn None
