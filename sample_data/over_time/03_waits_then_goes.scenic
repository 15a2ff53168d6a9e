# The ego stands still, then goes; nobody on foot is near once it goes.
model scenic.domains.driving.model

ego = new Car
walker = new Pedestrian

monitor WaitsThenGoes(car):
    while car.speed < 0.5:
        wait
    while car.speed < 4:
        require (distance from car to walker) > 10
        wait
    terminate

require ego.speed < 0.1
require monitor WaitsThenGoes(ego)
