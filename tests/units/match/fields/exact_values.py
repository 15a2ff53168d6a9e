"""Values of expressions as exact rationals: what enclosures are tested against, by arithmetic that rounds nothing.

A value is a pair of fractions between which it lies. Rational operations are exact, so that the pair is one number
unless a root, an angle or a logarithm is below; these are within 2**-200 of each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import cache
from itertools import product
from typing import TypeAlias

from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Constant,
    Coordinate,
    Identity,
    Node,
    Norm,
    Rotate,
    Scale,
    Select,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, is_leaf, postorder

Exact: TypeAlias = tuple[Fraction, Fraction]
ExactVector: TypeAlias = tuple[Exact, Exact]

BITS = 200
GRID = 1 << BITS
FINE = BITS + 64
FAR = 1 << 40
"""An angle beyond this counts as none: what whole turns are off adds up."""
LARGEST = Fraction(2) ** 1000
"""Beyond this a value counts as none: floating point has an end."""


class NoValueError(Exception):
    """An expression has no value, or none that can be told in so many bits."""


def point(value: float | Fraction) -> Exact:
    """A number that is known exactly."""
    return Fraction(value), Fraction(value)


def _rounded(low: Fraction, high: Fraction) -> Exact:
    """The pair on the grid of 2**-200, rounded outwards."""
    if low == high:
        return low, high
    return Fraction(math.floor(low * GRID), GRID), Fraction(math.ceil(high * GRID), GRID)


def _around(value: Fraction) -> Exact:
    """A value of a series, which is off by less than four steps of the grid."""
    nearest = round(value * GRID)
    return Fraction(nearest - 4, GRID), Fraction(nearest + 4, GRID)


def _fine(value: Fraction) -> int:
    """A number in steps of 2**-FINE."""
    return (value.numerator << FINE) // value.denominator


def _series(term: int, factor: Callable[[int, int], int]) -> Fraction:
    """A sum of terms in steps of 2**-FINE that shrink, each made of the one before; off by a step for each of them."""
    total, number = 0, 0
    while abs(term) > 1:
        total += term
        number += 1
        term = factor(term, number)
    return Fraction(total, 1 << FINE)


def _arc_tangent_below_half(x: Fraction) -> Fraction:
    power = first = _fine(x)
    square = first * first >> FINE
    total, number = 0, 0
    while abs(power) > 1:
        total += (-power if number % 2 else power) // (2 * number + 1)
        power = power * square >> FINE
        number += 1
    return Fraction(total, 1 << FINE)


@cache
def pi() -> Fraction:
    """Half a turn, within 2**-198."""
    return 16 * _arc_tangent_below_half(Fraction(1, 5)) - 4 * _arc_tangent_below_half(Fraction(1, 239))


def _root(x: Exact) -> Exact:
    if x[0] < 0:
        raise NoValueError

    def floor(value: Fraction) -> int:
        return math.isqrt((value.numerator << 2 * BITS) // value.denominator)

    low, high = floor(x[0]), floor(x[1])
    exact = Fraction(low, GRID) ** 2 == x[0] == x[1]
    return Fraction(low, GRID), Fraction(high if exact else high + 1, GRID)


def _sine_of(x: Fraction) -> Fraction:
    turn = _fine(2 * pi())
    near = (_fine(x) + turn // 2) % turn - turn // 2
    square = near * near >> FINE
    return _series(near, lambda term, n: (-term * square >> FINE) // ((2 * n) * (2 * n + 1)))


def _monotone(function: Callable[[Fraction], Fraction], x: Exact) -> Exact:
    """A function that changes by no more than its argument, at a pair that is hardly apart."""
    if x[1] - x[0] > Fraction(1, 1 << 150) or abs(x[0]) > FAR:
        raise NoValueError
    low, high = _around(function(x[0]))
    return low - (x[1] - x[0]) * 2, high + (x[1] - x[0]) * 2


def sine(x: Exact) -> Exact:
    """The sine."""
    return _monotone(_sine_of, x)


def cosine(x: Exact) -> Exact:
    """The cosine."""
    return _monotone(lambda each: _sine_of(each + pi() / 2), x)


def _arc_tangent_of(x: Fraction) -> Fraction:
    """The arc tangent of a number of at most 1."""
    shrunk, times = x, 1
    while abs(shrunk) > Fraction(1, 4):
        low, high = _root(point(1 + shrunk * shrunk))
        shrunk, times = shrunk / (1 + (low + high) / 2), times * 2
        shrunk = Fraction(_fine(shrunk), 1 << FINE)
    return times * _arc_tangent_below_half(shrunk)


def angle(y: Exact, x: Exact) -> Exact:
    """The arc tangent of y / x in its quadrant."""
    (y0, y1), (x0, x1) = y, x
    if max(y1 - y0, x1 - x0) > Fraction(1, 1 << 150) * max(abs(x0), abs(y0)):
        raise NoValueError
    if y0 <= 0 <= y1 and (x0 <= 0 or y0 != y1):
        # at the seam, and where both are zero, conventions differ
        raise NoValueError
    if abs(y0) <= abs(x0):
        found = _arc_tangent_of(y0 / x0) + (0 if x0 > 0 else pi() if y0 > 0 else -pi())
    else:
        found = (pi() / 2 if y0 > 0 else -pi() / 2) - _arc_tangent_of(x0 / y0)
    low, high = _around(found)
    wide = Fraction(1, 1 << 148)
    return (low, high) if y0 == y1 and x0 == x1 else (low - wide, high + wide)


def exponential(x: Exact) -> Exact:
    """The exponential."""
    if not -500 < x[0] <= x[1] < 500 or x[1] - x[0] > Fraction(1, 1 << 120):
        raise NoValueError
    halvings = 12
    small = _fine(x[0] / (1 << halvings))
    value = _series(1 << FINE, lambda term, n: (term * small >> FINE) // n)
    error = Fraction(1, 1 << 180)
    low, high = value - error, value + error
    for _ in range(halvings):
        low, high = _rounded(low * low, high * high)
    return low, high * (1 + 2 * (x[1] - x[0]))


def logarithm(x: Exact) -> Exact:
    """The natural logarithm."""
    if x[0] <= 0 or (x[1] - x[0]) > x[0] * Fraction(1, 1 << 150):
        raise NoValueError

    def above_one(value: Fraction) -> Fraction:
        power = _fine((value - 1) / (value + 1))
        square, total, number = power * power >> FINE, 0, 1
        while abs(power) > 1:
            total += 2 * power // number
            power = power * square >> FINE
            number += 2
        return Fraction(total, 1 << FINE)

    twos = math.floor(math.log2(x[0])) if x[0] < LARGEST else 0
    low, high = _around(above_one(x[0] / Fraction(2) ** twos) + twos * above_one(Fraction(2)))
    wide = Fraction(abs(twos) + 8, 1 << 148)
    return low - wide, high + wide


def _quotient(a: Exact, b: Exact) -> Exact:
    if b[0] <= 0 <= b[1]:
        raise NoValueError
    ends = [p / q for p, q in product(a, b)]
    return _rounded(min(ends), max(ends))


def _product(a: Exact, b: Exact) -> Exact:
    ends = [p * q for p, q in product(a, b)]
    return _rounded(min(ends), max(ends))


def _sum(a: Exact, b: Exact) -> Exact:
    return a[0] + b[0], a[1] + b[1]


def _opposite(a: Exact) -> Exact:
    return -a[1], -a[0]


def _magnitude(a: Exact) -> Exact:
    if a[0] < 0 < a[1]:
        return Fraction(0), max(-a[0], a[1])
    return a if a[0] >= 0 else _opposite(a)


def _power(a: Exact, exponent: Exact) -> Exact:
    if exponent[0] != exponent[1] or exponent[0].denominator != 1 or abs(exponent[0]) > 8:
        if a[0] <= 0:
            raise NoValueError
        return exponential(_product(exponent, logarithm(a)))
    base, found = a, point(1)
    for _ in range(abs(int(exponent[0]))):
        found = _product(found, base)
    return found if exponent[0] >= 0 else _quotient(point(1), found)


def _floor(a: Exact) -> Exact:
    if math.floor(a[0]) != math.floor(a[1]):
        raise NoValueError
    return point(Fraction(math.floor(a[0])))


def _wrapped(a: Exact) -> Exact:
    if abs(a[0]) > FAR:
        raise NoValueError
    turns = round(a[0] / (2 * pi()))
    low, high = (each - 2 * pi() * turns for each in a)
    if abs(low) > pi() - Fraction(1, 1 << 40):
        # which end straight behind is, is a convention
        raise NoValueError
    return low - Fraction(abs(turns) + 1, 1 << 190), high + Fraction(abs(turns) + 1, 1 << 190)


def _arc_sine(a: Exact) -> Exact:
    rest = (1 - max(a[0] * a[0], a[1] * a[1]), 1 - min(a[0] * a[0], a[1] * a[1]))
    return angle(a, _root(rest))


_OPERATIONS: dict[ArithmeticOp, Callable[..., Exact]] = {
    ArithmeticOp.ADD: _sum,
    ArithmeticOp.SUB: lambda a, b: _sum(a, _opposite(b)),
    ArithmeticOp.MUL: _product,
    ArithmeticOp.DIV: _quotient,
    ArithmeticOp.FLOORDIV: lambda a, b: _floor(_quotient(a, b)),
    ArithmeticOp.MOD: lambda a, b: _sum(a, _opposite(_product(b, _floor(_quotient(a, b))))),
    ArithmeticOp.POW: _power,
    ArithmeticOp.NEG: _opposite,
    ArithmeticOp.ABS: _magnitude,
    ArithmeticOp.MIN: lambda *args: (min(each[0] for each in args), min(each[1] for each in args)),
    ArithmeticOp.MAX: lambda *args: (max(each[0] for each in args), max(each[1] for each in args)),
    ArithmeticOp.SQRT: _root,
    ArithmeticOp.SIN: sine,
    ArithmeticOp.COS: cosine,
    ArithmeticOp.TAN: lambda a: _quotient(sine(a), cosine(a)),
    ArithmeticOp.ASIN: _arc_sine,
    ArithmeticOp.ACOS: lambda a: _sum(_around(pi() / 2), _opposite(_arc_sine(a))),
    ArithmeticOp.ATAN: lambda a: angle(a, point(1)),
    ArithmeticOp.ATAN2: angle,
    ArithmeticOp.EXP: exponential,
    ArithmeticOp.LOG: logarithm,
    ArithmeticOp.FLOOR: _floor,
    ArithmeticOp.CEIL: lambda a: _opposite(_floor(_opposite(a))),
    ArithmeticOp.WRAP: _wrapped,
}


def _value(node: Node, args: list[Exact | ExactVector]) -> Exact | ExactVector:
    below: list = args
    match node:
        case Constant(value=float() as number):
            return point(number)
        case Constant(value=(float() as x, float() as y)):
            return point(x), point(y)
        case Arithmetic():
            return _OPERATIONS[node.op](*below)
        case VectorOf():
            return below[0], below[1]
        case Coordinate():
            return below[0][node.axis]
        case VectorSum():
            return _sum(below[0][0], below[1][0]), _sum(below[0][1], below[1][1])
        case Scale():
            return _product(below[0][0], below[1]), _product(below[0][1], below[1])
        case Rotate():
            (x, y), (s, c) = below[0], (sine(below[1]), cosine(below[1]))
            across = _sum(_product(x, c), _opposite(_product(y, s)))
            return across, _sum(_product(x, s), _product(y, c))
        case Norm():
            x, y = map(_magnitude, below[0])
            return _root(_sum(_product(x, x), _product(y, y)))
        case Bearing():
            return angle(_opposite(below[0][0]), below[0][1])
        case Select():
            return below[1 + int(below[0][0])]
        case _:
            raise AssertionError(node)


def parts_of(value: Exact | ExactVector) -> list[Exact]:
    """A number alone, the coordinates of a vector."""
    return [value] if isinstance(value[0], Fraction) else list(value)  # type: ignore[list-item,arg-type]


def exact_values(root: Node, given: Mapping[Identity, Exact | ExactVector]) -> dict[int, Exact | ExactVector]:
    """The values of all nodes below a root that have one, by their ids.

    Args:
        root: The expression.
        given: The values of the random variables.
    """
    found: dict[int, Exact | ExactVector] = {}
    for node in postorder([root]):
        if is_leaf(node):
            found[id(node)] = given[node.identity]  # type: ignore[union-attr]
            continue
        try:
            value = _value(node, [found[id(child)] for child in children(node)])
        except (KeyError, NoValueError):
            # one below has none
            continue
        if all(abs(end) < LARGEST for part in parts_of(value) for end in part):
            found[id(node)] = value
    return found
