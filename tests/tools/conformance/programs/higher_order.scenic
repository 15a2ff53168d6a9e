# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
spots = sorted(filter(lambda s: s[0] > 10, map(lambda x: (x * 5, 9), range(5))), key=lambda s: -s[0])
new Object at spots[0], with width max(1, 2)
assert any([s[1] > 8 for s in spots]) and all([s[0] for s in spots])
