# sharp: position heading
model scenic.domains.driving.model
ego = new Car
last = ego
for i in range(3):
    last = new Car ahead of last by Range(2, 4), facing Range(-5, 5) deg relative to last.heading
