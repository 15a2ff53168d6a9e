# sharp: position heading
ego = Object at 3 @ -4, facing 40 deg, with width 2, with length 5
def row(start, count, gap=6):
    last = start
    for i in range(count):
        last = Object at last offset by 1 @ gap, with length 2, facing 9 deg
    return last

row(ego, 3, gap=Range(7, 8))
