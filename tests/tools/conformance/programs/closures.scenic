# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
def maker(step):
    def make(n):
        return new Object at (step * n, 14)
    return make

make = maker(9)
make(1)
last = make(3)
assert isinstance(last, Object)
