param weather = Uniform('ClearNoon', 'HardRainNoon')
param carla_map = 'Town01'
model scenic.simulators.carla.model
ego = new Car
new Car on road
