ego = new Object at (3, -4), facing Range(0, 360) deg
new Object ahead of ego by Range(4, 9)
