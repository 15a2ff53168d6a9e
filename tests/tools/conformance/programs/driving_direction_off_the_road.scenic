# differs: Scenic 3.1.1 gives roadDirection the heading 0 off the road
model scenic.domains.driving.model
ego = new Car
new Pedestrian on sidewalk, facing roadDirection
