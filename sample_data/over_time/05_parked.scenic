# A car that stands as long as it is seen: with `--min-duration 12` one that stands for a whole recording.
model scenic.domains.driving.model

ego = new Car
parked = new Car

require always parked.speed < 0.2
