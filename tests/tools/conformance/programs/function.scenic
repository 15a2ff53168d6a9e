# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
def row(start, count, gap=6):
    last = start
    for i in range(count):
        last = new Object ahead of last by gap, with length 2
    return last

row(ego, 3, gap=Range(2, 3))
