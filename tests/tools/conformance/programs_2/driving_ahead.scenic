# sharp: position heading
model scenic.domains.driving.model
ego = Car
Car ahead of (front of ego) by Range(4, 10)
