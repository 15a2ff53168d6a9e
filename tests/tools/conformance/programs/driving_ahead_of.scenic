# sharp: position heading
model scenic.domains.driving.model
ego = new Car
new Car ahead of ego by Range(4, 10)
