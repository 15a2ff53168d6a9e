model scenic.domains.driving.model
ego = new Pedestrian on sidewalk
new Pedestrian on network.sidewalkAt(ego, reject=True)
