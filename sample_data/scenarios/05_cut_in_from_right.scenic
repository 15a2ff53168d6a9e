# A car in the lane to the right cuts in front of the ego.
model scenic.domains.driving.model

besideAnother = []
for lane in network.lanes:
    for section in lane.sections:
        if section._laneToRight is not None:
            besideAnother.append(section)

ego = new Car on Uniform(*besideAnother),
    facing Range(-15, 15) deg relative to roadDirection

cutting = new Car offset by (Range(0, 4), Range(0, 5)),
    facing Uniform(1, -1) * Range(15, 30) deg relative to roadDirection
