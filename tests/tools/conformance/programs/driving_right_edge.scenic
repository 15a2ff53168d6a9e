# tolerance: position=0.05 Scenic keeps edges of lanes that lie beside their polygons
model scenic.domains.driving.model
road = Uniform(*network.roads)
lane = Uniform(*road.lanes)
ego = new Car on lane.centerline
spot = new OrientedPoint on lane.rightEdge
other = new Car left of spot by 0.5, facing roadDirection
require (distance from ego to other) > 7
