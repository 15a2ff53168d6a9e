# A pedestrian in the roadway, walking across the ego's path or towards it.
model scenic.domains.driving.model

roadway = network.laneRegion.union(network.intersectionRegion)

ego = new Car on roadway,
    facing Range(-15, 15) deg relative to roadDirection

pedestrian = new Pedestrian on roadway,
    facing Range(-180, 180) deg

require abs(relative heading of pedestrian) > 70 deg
