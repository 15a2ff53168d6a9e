# sharp: position heading
class Base:
    tags[additive]: 1
    code[final]: 7
    width: 2

class Derived(Base):
    tags[additive]: 2

ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Derived at (len([1, 2]) * 8, 12), with length 3
