# Classes of Scenic's general model for the Webots simulator: what counts in the plane.

class WebotsObject:
    requireVisible: False
    elevation = None
    webotsAdhoc: None
    webotsName: None
    webotsType: None
    webotsObject: None
    controller: None
    resetController: True
    positionOffset: (0, 0, 0)
    rotationOffset: (0, 0, 0)
    density: None

class Ground(WebotsObject):
    allowCollisions: True
    webotsName: "GROUND"
    width: 10
    length: 10
    gridSize: 20
    gridSizeX: self.gridSize
    gridSizeY: self.gridSize
    baseThickness: 0.1
    terrain: ()

class Terrain:
    allowCollisions: True

class Hill(Terrain):
    height: 1
    spread: 0.25
    render: False
