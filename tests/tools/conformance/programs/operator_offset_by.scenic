# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
spot = ego offset by (4, 12)
new Object at spot, facing spot.heading
