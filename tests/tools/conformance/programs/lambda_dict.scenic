# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
shift = lambda x, step=2: x + step
places = {'near': (shift(10), 5), 'far': (shift(26, step=4), 5)}
new Object at places['far']
