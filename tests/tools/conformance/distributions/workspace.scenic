workspace = Workspace(RectangularRegion((0, 0), 0, 30, 20))
ego = new Object at (Normal(0, 9), Normal(0, 9)), facing Range(0, 360) deg, with width 4, with length 7
