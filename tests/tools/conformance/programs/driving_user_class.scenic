# sharp: heading
model scenic.domains.driving.model
class BigCar(Car):
    width: 3
    length: 7
    roadDeviation: Range(-5, 5) deg

ego = new Car
new BigCar
