# A car that is parked beside the road, a little ahead of the ego.
model scenic.domains.driving.model

ego = new Car

gap = Range(4, 20)

parkedCar = new Car offset by Range(3, 5.5) @ gap,
    facing Range(-10, 10) deg relative to ego.heading
