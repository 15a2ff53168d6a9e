"""Programs that would never end, or take all memory, if nothing counted their steps."""

__all__ = ["END", "HOSTILE", "TOO_LONG"]

END = "ego = new Object\n"
HOSTILE = {
    "endless loop": "while True:\n    pass\n",
    "growing list": "l = []\nwhile True:\n    l.append(1)\n",
    "list added to itself": "l = [1]\nfor i in range(99):\n    l += l\n",
    "any without end": "while True:\n    any([0] * 99999)\n",
    "rounding without end": "x = Range(0, 10 ** 15)\nfor i in range(2000):\n    x = int(x) + round(x, 3)\n",
    "growing string": "s = 'a'\nfor i in range(100):\n    s = s + s\n",
    "growing replacement": "s = 'a' * 50000\nt = s.replace('a', s)\n",
    "many long lists": "l = []\nfor i in range(50000):\n    l.append(list(range(50000)))\n",
    "nested multiplication": "l = [0] * 1000\nfor i in range(10):\n    l = [l] * 1000\nx = l == [l]\n",
    "shared lists compared": "a = [0]\nb = [0]\nfor i in range(60):\n    a = [a, a]\n    b = [b, b]\nx = a == b\n",
    "shared lists searched": (
        "a = [0]\nb = [0]\nfor i in range(60):\n    a = [a, a]\n    b = [b, b]\nx = [b].index(a)\n"
    ),
    "shared tuples hashed": "t = (0,)\nfor i in range(60):\n    t = (t, t)\nd = {t: 1}\n",
    "a list in itself": "l = []\nl.append(l)\nx = l == [l]\n",
    "huge power": "x = 10 ** 10 ** 8\n",
    "huge shift": "x = 1 << 10 ** 9\n",
    "repeated squares": "x = 3\nfor i in range(100):\n    x = x * x\n",
    "endless recursion": "def f(n):\n    return f(n + 1)\nx = f(0)\n",
    "exploding recursion": "def f(n):\n    return [f(n - 1), f(n - 1)] if n else 0\nx = f(30)\n",
    "exploding choice": "a = new Point\nx = Uniform(a, new Point)\nfor i in range(60):\n    x = Uniform(x, x, a)\n",
    "exploding region": (
        "r = CircularRegion((0, 0), 1)\nq = CircularRegion((1, 0), 1)\n"
        "for i in range(60):\n    r = r.union(q).intersect(r.union(r.difference(q)))\n"
    ),
    "endless objects": "ego = new Object\nfor i in range(90000):\n    new Object at (i, 0)\n",
    "searching": "l = list(range(50000))\nwhile True:\n    x = -1 in l\n",
    "sorting": "l = list(range(50000))\nwhile True:\n    l = sorted(l)\n",
    "nested comprehensions": "x = [[[0 for a in range(999)] for b in range(999)] for c in range(999)]\n",
    "pairs": "x = {(a, b) for a in range(9999) for b in range(9999)}\n",
    "two calls each": "def f(n):\n    return f(n - 1) + f(n - 2) if n > 1 else n\nx = f(38)\n",
    "two choices": "a, b = [Uniform(*[new Point for i in range(300)]) for j in (0, 1)]\nx = distance from a to b\n",
    "a long sum": "x = " + "+".join(["1"] * 90000) + "\n",
    "a class of itself": "class A:\n    part: new A\nego = new A\n",
}
TOO_LONG = {
    "many lines": "x = 1\n" * 60_000,
    "a long string": "x = '" + "a" * 100_000_000 + "'\n",
    "many parts of a string": "x = f'" + "{1}" * 60_000 + "'\n",
    "a long comment": "#" * 10_000_000,
}
