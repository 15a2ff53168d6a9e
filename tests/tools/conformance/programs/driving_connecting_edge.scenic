# tolerance: position=0.05 Scenic keeps edges of lanes that lie beside their polygons
model scenic.domains.driving.model
lane = Uniform(*network.lanes)
ego = new Car on lane.centerline
other = new Car at (new OrientedPoint on lane.rightEdge)
require (distance from ego to other) > 6
