model scenic.simulators.newtonian.driving_model
ego = new Car
new Car ahead of ego by 4
