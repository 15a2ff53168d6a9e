# sharp: heading
model scenic.domains.driving.model
section = Uniform(*network.laneSections)
ego = new Car on section
