model scenic.domains.driving.model
lane = network.roads[2].lanes[0]
ego = new Car on lane
new Car on lane.successor, with regionContainedIn None
