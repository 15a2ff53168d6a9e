model scenic.domains.driving.model
crossing = Uniform(*filter(lambda i: i.is3Way, network.intersections))
ego = new Car on crossing, facing Range(0, 360) deg
