# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5, with viewAngle 60 deg
new Object ahead of ego by Range(3, 5), visible
