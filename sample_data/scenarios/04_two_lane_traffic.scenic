# Traffic on a two-lane road: one car ahead of the ego, two oncoming cars, the second ahead of the first.
model scenic.domains.driving.model

roadway = network.laneRegion.union(network.intersectionRegion)

ego = new Car on roadway,
    facing Range(-15, 15) deg relative to roadDirection

leader = new Car ahead of ego by (Range(-1, 1), Range(0, 40)),
    facing Range(-15, 15) deg relative to roadDirection

oncoming = new Car offset by (Range(-10, -1), Range(0, 50)),
    facing Range(140, 220) deg relative to ego.heading

second = new Car ahead of oncoming by (Range(-1, 1), Range(0, 40)),
    facing Range(-15, 15) deg relative to roadDirection
