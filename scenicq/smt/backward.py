"""Inverse interval arithmetic: what arguments a function can have had, given its range.

Each function takes the interval of the result and those of the arguments, and returns intervals of the arguments, to be
intersected with the old ones: no argument that has a result in range is lost. Part of the portable solver.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from math import inf

from scenicq.smt.formula import Operator
from scenicq.smt.interval import (
    ALL,
    WIDE,
    EmptyError,
    Interval,
    add,
    arc_cosine,
    arc_sine,
    arc_tangent,
    cosine,
    divide,
    exponential,
    logarithm,
    multiply,
    negate,
    power,
    sine,
    square_root,
    subtract,
    tangent,
    widen,
)

__all__ = ["BACKWARD", "root"]


def _sum(r: Interval, a: Interval, b: Interval) -> tuple[Interval, Interval]:
    return subtract(r, b), subtract(r, a)


def _difference(r: Interval, a: Interval, b: Interval) -> tuple[Interval, Interval]:
    return add(r, b), subtract(a, r)


def _product(r: Interval, a: Interval, b: Interval) -> tuple[Interval, Interval]:
    return _factor(r, b), _factor(r, a)


def _factor(r: Interval, other: Interval) -> Interval:
    """The factors that can make the product, which are all if both it and the other factor can be 0."""
    return ALL if other[0] <= 0.0 <= other[1] and r[0] <= 0.0 <= r[1] else divide(r, other)


def _quotient(r: Interval, a: Interval, b: Interval) -> tuple[Interval, Interval]:
    return multiply(r, b), _factor(a, r)


def _opposite(r: Interval, _: Interval) -> tuple[Interval]:
    return (negate(r),)


def _absolute(r: Interval, a: Interval) -> tuple[Interval]:
    return (_mirrored(r, a),)


def _mirrored(r: Interval, a: Interval) -> Interval:
    """The arguments whose absolute value lies in a range."""
    low, high = max(r[0], 0.0), r[1]
    if high < 0.0:
        raise EmptyError
    return (low if a[0] > -low else -high), (-low if a[1] < low else high)


def _minimum(r: Interval, a: Interval, b: Interval) -> tuple[Interval, Interval]:
    return (r[0], r[1] if b[0] > r[1] else inf), (r[0], r[1] if a[0] > r[1] else inf)


def _maximum(r: Interval, a: Interval, b: Interval) -> tuple[Interval, Interval]:
    return (r[0] if b[1] < r[0] else -inf, r[1]), (r[0] if a[1] < r[0] else -inf, r[1])


def _square_root(r: Interval, _: Interval) -> tuple[Interval]:
    if r[1] < 0.0:
        raise EmptyError
    return (power((max(r[0], 0.0), r[1]), 2),)


def _sine(r: Interval, a: Interval) -> tuple[Interval]:
    low, high = arc_sine(r)
    return (_periodic(a, ((low, high), (math.pi - high, math.pi - low)), 2 * math.pi),)


def _cosine(r: Interval, a: Interval) -> tuple[Interval]:
    low, high = arc_cosine(r)
    return (_periodic(a, ((low, high), (-high, -low)), 2 * math.pi),)


def _tangent(r: Interval, a: Interval) -> tuple[Interval]:
    return (_periodic(a, (arc_tangent(r),), math.pi),)


def _periodic(a: Interval, branches: Sequence[Interval], period: float) -> Interval:
    """The hull of the part of an interval that lies in the branches, moved by whole periods."""
    if not (a[0] > -WIDE and a[1] < WIDE):
        return a
    slack = 1e-14 * max(1.0, abs(a[0]), abs(a[1]))
    lows = [low + math.ceil((a[0] - slack - high) / period) * period for low, high in branches]
    highs = [high + math.floor((a[1] + slack - low) / period) * period for low, high in branches]
    return min(lows) - slack, max(highs) + slack


def _arc_sine(r: Interval, _: Interval) -> tuple[Interval]:
    low, high = max(r[0], -math.pi / 2), min(r[1], math.pi / 2)
    if low > high:
        low, high = _end(r, -math.pi / 2, math.pi / 2)
    return (_unit(math.sin(low), math.sin(high)),)


def _arc_cosine(r: Interval, _: Interval) -> tuple[Interval]:
    low, high = max(r[0], 0.0), min(r[1], math.pi)
    if low > high:
        low, high = _end(r, 0.0, math.pi)
    return (_unit(math.cos(high), math.cos(low)),)


def _end(r: Interval, low: float, high: float) -> Interval:
    """The end of a function's range next to an interval that misses it by no more than rounding."""
    if r[0] > high + 1e-14 or r[1] < low - 1e-14:
        raise EmptyError
    return (high, high) if r[0] > high else (low, low)


def _unit(low: float, high: float) -> Interval:
    low, high = widen(low, high)
    return max(low, -1.0), min(high, 1.0)


def _arc_tangent(r: Interval, _: Interval) -> tuple[Interval]:
    half = math.pi / 2
    if r[0] > half + 1e-14 or r[1] < -half - 1e-14:
        raise EmptyError
    low = tangent((r[0], r[0]))[0] if -half < r[0] < half else (-inf if r[0] <= -half else 1e15)
    high = tangent((r[1], r[1]))[1] if -half < r[1] < half else (inf if r[1] >= half else -1e15)
    return ((low, high),)


def _arc_tangent2(r: Interval, y: Interval, x: Interval) -> tuple[Interval, Interval]:
    low, high = widen(r[0], r[1])
    new_y, new_x = ALL, ALL
    if -math.pi < low and high < math.pi and high - low < math.pi:
        sin, cos = sine((low, high)), cosine((low, high))
        # y cos = x sin, and both have the sign of their ratio's function
        if not cos[0] <= 0.0 <= cos[1]:
            new_y = divide(multiply(x, sin), cos)
            new_x = (0.0, inf) if cos[0] > 0.0 else (-inf, 0.0)
        if not sin[0] <= 0.0 <= sin[1]:
            along = divide(multiply(y, cos), sin)
            new_x = max(new_x[0], along[0]), min(new_x[1], along[1])
            sign = (0.0, inf) if sin[0] > 0.0 else (-inf, 0.0)
            new_y = max(new_y[0], sign[0]), min(new_y[1], sign[1])
    return new_y, new_x


def _exponential(r: Interval, _: Interval) -> tuple[Interval]:
    return (logarithm(r),)


def _logarithm(r: Interval, _: Interval) -> tuple[Interval]:
    return (exponential(r),)


def root(r: Interval, a: Interval, exponent: int) -> Interval:
    """The arguments whose integer power lies in a range.

    Raises:
        EmptyError: There are none.
    """
    if exponent < 0:
        return root(_factor((1.0, 1.0), r), a, -exponent)
    if exponent == 0:
        return ALL
    if exponent == 1:
        return r
    if exponent % 2 == 0:
        if r[1] < 0.0:
            raise EmptyError
        return _mirrored((_root_end(max(r[0], 0.0), exponent, -1.0), _root_end(r[1], exponent, 1.0)), a)
    return _root_end(r[0], exponent, -1.0), _root_end(r[1], exponent, 1.0)


_SQUARE = 2


def _root_end(value: float, exponent: int, direction: float) -> float:
    if not value or math.isinf(value):
        return value
    if exponent == _SQUARE:
        return square_root((value, value))[1 if direction > 0.0 else 0]
    size = abs(value) ** (1.0 / exponent)
    return math.copysign(size, value) + direction * (size * 1e-12 + 1e-100)


BACKWARD: dict[Operator, Callable[..., tuple[Interval, ...]]] = {
    Operator.ADD: _sum,
    Operator.SUB: _difference,
    Operator.MUL: _product,
    Operator.DIV: _quotient,
    Operator.NEG: _opposite,
    Operator.ABS: _absolute,
    Operator.MIN: _minimum,
    Operator.MAX: _maximum,
    Operator.SQRT: _square_root,
    Operator.SIN: _sine,
    Operator.COS: _cosine,
    Operator.TAN: _tangent,
    Operator.ASIN: _arc_sine,
    Operator.ACOS: _arc_cosine,
    Operator.ATAN: _arc_tangent,
    Operator.ATAN2: _arc_tangent2,
    Operator.EXP: _exponential,
    Operator.LOG: _logarithm,
}
"""The arguments of each function of one or two arguments; integer powers have `root`."""
