# sharp: heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
places = [(20 + 10 * i, 5) for i in range(5)]
new Object at Uniform(*places)
