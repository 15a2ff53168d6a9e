# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
spots = [(10 + 5 * i, i ** 2) for i in range(6) if i % 2 == 1]
for spot in spots:
    new Object at spot
