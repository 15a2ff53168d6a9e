# The ego stands across or against the direction of traffic, with another car close by in view.
model scenic.domains.driving.model

ego = new Car with visibleDistance 50, with viewAngle 135 deg,
    facing Uniform(1, -1) * Range(90, 180) deg relative to roadDirection

other = new Car on visible road,
    facing Range(-15, 15) deg relative to roadDirection

require (distance to other) < 10
