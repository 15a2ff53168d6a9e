# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
def near():
    return 12
def far():
    return 24
new Object at (Uniform(near(), far()), 6)
