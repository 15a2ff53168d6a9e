workspace = Workspace(RectangularRegion((0, 0), 30 deg, 40, 30))
ego = new Object in workspace, with width 4
new Object in workspace, with width 4, with length 6, facing Range(0, 360) deg
