ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
def limit(x):
    return max(12, min(x, 18))

new Object at (limit(Range(0, 40)), abs(Range(-20, -10)))
