# sharp: heading
model scenic.domains.driving.model
class Walker(Pedestrian):
    position: new Point on road
    regionContainedIn: road

ego = new Car
new Walker facing 0 deg
