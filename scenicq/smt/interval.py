"""Interval arithmetic: the range of each function over intervals, rounded outwards.

An interval is a pair of floats whose ends may be infinite. Results hold every value that the function takes where it is
defined on the arguments. Sums, products, quotients and square roots are within half an ulp, the other
functions of the C library are taken to be within `LIBRARY` (relative, and absolute below 1); products below the least
double count as 0. Part of the portable solver.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from math import inf, nextafter

from scenicq.smt.formula import Operator

__all__ = ["FORWARD", "EmptyError", "Interval", "cosine", "divide", "multiply", "power", "widen"]

Interval = tuple[float, float]

LIBRARY = 4e-15
"""More than the error of the C library's functions."""
WIDE = 1e8
"""Arguments of periodic functions beyond this are not reduced."""
EXPONENT = 709.0
"""The exponential of a little more overflows."""
ALL: Interval = (-inf, inf)


class EmptyError(Exception):
    """No value is left."""


def widen(low: float, high: float, error: float = LIBRARY) -> Interval:
    """Add a relative error, absolute below 1, to both ends."""
    return low - error * max(1.0, abs(low)), high + error * max(1.0, abs(high))


def add(a: Interval, b: Interval) -> Interval:
    """The range of a sum; exact where the sum is 0, so that signs are kept."""
    low, high = a[0] + b[0], a[1] + b[1]
    return (nextafter(low, -inf) if low else low), (nextafter(high, inf) if high else high)


def negate(a: Interval) -> Interval:
    """The range of a negation."""
    return -a[1], -a[0]


def subtract(a: Interval, b: Interval) -> Interval:
    """The range of a difference."""
    return add(a, (-b[1], -b[0]))


def multiply(a: Interval, b: Interval) -> Interval:
    """The range of a product of independent factors."""
    products = [p * q if p and q else 0.0 for p in a for q in b]
    low, high = min(products), max(products)
    exact_low = low == 0.0 and (0.0 in a or 0.0 in b)
    exact_high = high == 0.0 and (0.0 in a or 0.0 in b)
    return (low if exact_low else nextafter(low, -inf)), (high if exact_high else nextafter(high, inf))


def divide(a: Interval, b: Interval) -> Interval:
    """The range of a quotient.

    Raises:
        EmptyError: The divisor is 0.
    """
    low, high = b
    if low == 0.0 == high:
        raise EmptyError
    if low < 0.0 < high or ((low == 0.0 or high == 0.0) and a[0] <= 0.0 <= a[1]):
        if low == 0.0 and a[0] == 0.0:
            return 0.0, inf
        return ALL
    if low == 0.0:
        return (nextafter(a[0] / high, -inf), inf) if a[0] > 0.0 else (-inf, nextafter(a[1] / high, inf))
    if high == 0.0:
        return (-inf, nextafter(a[0] / low, inf)) if a[0] > 0.0 else (nextafter(a[1] / low, -inf), inf)
    quotients = [_quotient(p, q) for p in a for q in b]
    least, most = min(quotients), max(quotients)
    exact_low = least == 0.0 and 0.0 in a
    exact_high = most == 0.0 and 0.0 in a
    return (least if exact_low else nextafter(least, -inf)), (most if exact_high else nextafter(most, inf))


def _quotient(p: float, q: float) -> float:
    return 0.0 if math.isinf(q) else p / q


def absolute(a: Interval) -> Interval:
    """The range of an absolute value."""
    if a[0] >= 0.0:
        return a
    return (-a[1], -a[0]) if a[1] <= 0.0 else (0.0, max(-a[0], a[1]))


def square_root(a: Interval) -> Interval:
    """The range of a square root.

    Raises:
        EmptyError: Only negative numbers.
    """
    if a[1] < 0.0:
        raise EmptyError
    low = nextafter(math.sqrt(a[0]), 0.0) if a[0] > 0.0 else 0.0
    return low, nextafter(math.sqrt(a[1]), inf) if a[1] else 0.0


def sine(a: Interval) -> Interval:
    """The range of a sine."""
    return _wave(a, math.sin, math.pi / 2)


def cosine(a: Interval) -> Interval:
    """The range of a cosine."""
    return _wave(a, math.cos, 0.0)


def _wave(a: Interval, function: Callable[[float], float], crest: float) -> Interval:
    low, high = a
    if not (low > -WIDE and high < WIDE and high - low < 2 * math.pi):
        return -1.0, 1.0
    ends = function(low), function(high)
    least, most = widen(min(ends), max(ends))
    return (
        -1.0 if _meets(low, high, crest + math.pi) else max(-1.0, least),
        1.0 if _meets(low, high, crest) else min(1.0, most),
    )


def _meets(low: float, high: float, point: float, period: float = 2 * math.pi) -> bool:
    """Whether an interval may hold a point or one that lies whole periods away."""
    slack = 1e-15 * max(1.0, abs(low), abs(high)) * 4
    turns = math.ceil((low - slack - point) / period)
    return point + turns * period <= high + slack


def tangent(a: Interval) -> Interval:
    """The range of a tangent."""
    low, high = a
    if not (low > -WIDE and high < WIDE and high - low < math.pi) or _meets(low, high, math.pi / 2, math.pi):
        return ALL
    ends = math.tan(low), math.tan(high)
    return widen(min(ends), max(ends)) if ends[0] <= ends[1] else ALL


def arc_sine(a: Interval) -> Interval:
    """The range of an arc sine.

    Raises:
        EmptyError: Nothing between -1 and 1.
    """
    low, high = _clipped(a)
    return widen(math.asin(low), math.asin(high))


def arc_cosine(a: Interval) -> Interval:
    """The range of an arc cosine.

    Raises:
        EmptyError: Nothing between -1 and 1.
    """
    low, high = _clipped(a)
    return widen(math.acos(high), math.acos(low))


def _clipped(a: Interval) -> Interval:
    if a[0] > 1.0 or a[1] < -1.0:
        raise EmptyError
    return max(a[0], -1.0), min(a[1], 1.0)


def arc_tangent(a: Interval) -> Interval:
    """The range of an arc tangent."""
    return widen(math.atan(a[0]), math.atan(a[1]))


def arc_tangent2(y: Interval, x: Interval) -> Interval:
    """The range of the direction (in (-π, π], from +x) of the points of a box but the origin.

    Raises:
        EmptyError: The box is the origin.
    """
    if y == x == (0.0, 0.0):
        raise EmptyError
    if y[0] < 0.0 <= y[1] and x[0] < 0.0:
        return widen(-math.pi, math.pi)
    # adding 0.0 turns -0.0 into 0.0
    corners = [math.atan2(b + 0.0, a + 0.0) for b in y for a in x]
    return widen(min(corners), max(corners))


def exponential(a: Interval) -> Interval:
    """The range of an exponential."""
    low = math.exp(min(a[0], EXPONENT))
    high = math.exp(a[1]) if a[1] < EXPONENT else inf
    return max(0.0, low - LIBRARY * low - 1e-300), high + LIBRARY * high + 1e-300


def logarithm(a: Interval) -> Interval:
    """The range of a natural logarithm.

    Raises:
        EmptyError: No positive number.
    """
    if a[1] <= 0.0:
        raise EmptyError
    return widen(math.log(a[0]) if a[0] > 0.0 else -inf, math.log(a[1]))


def power(a: Interval, exponent: int) -> Interval:
    """The range of an integer power.

    Raises:
        EmptyError: A negative power of 0.
    """
    if exponent < 0:
        return divide((1.0, 1.0), power(a, -exponent))
    if exponent == 0:
        return 1.0, 1.0
    if exponent == 1:
        return a
    base = absolute(a) if exponent % 2 == 0 else a
    return _power_end(base[0], exponent, -inf), _power_end(base[1], exponent, inf)


def _power_end(base: float, exponent: int, towards: float) -> float:
    if not base:
        return 0.0
    try:
        value = base**exponent
    except OverflowError:
        value = -inf if base < 0.0 and exponent % 2 else inf
    if math.isinf(value):
        return value if math.isinf(base) or (value > 0.0) == (towards > 0.0) else math.copysign(1.7e308, value)
    error = abs(value) * LIBRARY + 1e-300
    return value + error if towards > 0.0 else value - error


def _least(a: Interval, b: Interval) -> Interval:
    return min(a[0], b[0]), min(a[1], b[1])


def _most(a: Interval, b: Interval) -> Interval:
    return max(a[0], b[0]), max(a[1], b[1])


FORWARD: dict[Operator, Callable[..., Interval]] = {
    Operator.ADD: add,
    Operator.SUB: subtract,
    Operator.MUL: multiply,
    Operator.DIV: divide,
    Operator.NEG: negate,
    Operator.ABS: absolute,
    Operator.MIN: _least,
    Operator.MAX: _most,
    Operator.SQRT: square_root,
    Operator.SIN: sine,
    Operator.COS: cosine,
    Operator.TAN: tangent,
    Operator.ASIN: arc_sine,
    Operator.ACOS: arc_cosine,
    Operator.ATAN: arc_tangent,
    Operator.ATAN2: arc_tangent2,
    Operator.EXP: exponential,
    Operator.LOG: logarithm,
}
"""The range of each function of one or two arguments; integer powers have `power`."""
