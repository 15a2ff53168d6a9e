param carla_map = 'Town01'
model scenic.simulators.carla.model
ego = new Car
new Truck on road
new Pedestrian
new Trash
