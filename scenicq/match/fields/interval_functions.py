"""What operations on numbers make of intervals, and what a result says of their arguments: rounded outwards.

A range holds every value that an operation has on its arguments, where it has one; where it has none at all, it is
everything. The way back holds all arguments that have a result within bounds; it takes for granted that there is a
result, which is so for what must be compared, but not for an option that may not be chosen (`PARTIAL`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.nodes import ArithmeticOp
from scenicq.match.fields import interval_domain as domain
from scenicq.match.fields.interval_domain import Enclosure
from scenicq.match.tolerance import ROUNDING

__all__ = ["PARTIAL", "arguments_of", "range_of"]

PARTIAL = {
    ArithmeticOp.DIV, ArithmeticOp.POW, ArithmeticOp.SQRT, ArithmeticOp.ASIN, ArithmeticOp.ACOS, ArithmeticOp.LOG,
}  # fmt: skip
"""Operations that have no value for some numbers, of which the way back takes for granted that they have one."""

_ONE: Enclosure = np.ones((2, 1))
_QUARTER = math.pi / 2
_ROOT = 1e-12
"""More than the relative error of a root by way of a power."""
_FAR = 1e6
"""Radians beyond which nothing is told of periods."""
_GREATEST_EXPONENT = 64
"""Whole exponents up to this are powers; others go by the logarithm."""


def range_of(op: ArithmeticOp, args: Sequence[Enclosure]) -> Enclosure:
    """The values of an operation.

    Args:
        op: The operation.
        args: Its arguments, (2, n) each.
    """
    first, last = args[0], args[-1]
    match op:
        case ArithmeticOp.ADD:
            return reduce(domain.add, args)
        case ArithmeticOp.SUB:
            return domain.subtract(first, last)
        case ArithmeticOp.MUL:
            return reduce(domain.times, args)
        case ArithmeticOp.DIV:
            return domain.divide(first, last)
        case ArithmeticOp.FLOORDIV:
            return np.floor(domain.divide(first, last))
        case ArithmeticOp.MOD:
            return _remainder(first, last)
        case ArithmeticOp.POW:
            return _power(first, last)
        case ArithmeticOp.NEG:
            return domain.negative(first)
        case ArithmeticOp.ABS:
            return domain.magnitude(first)
        case ArithmeticOp.MIN:
            return reduce(np.minimum, args)
        case ArithmeticOp.MAX:
            return reduce(np.maximum, args)
        case ArithmeticOp.SQRT:
            return _square_root(first)
        case ArithmeticOp.SIN:
            return domain.turning(first)[0]
        case ArithmeticOp.COS:
            return domain.turning(first)[1]
        case ArithmeticOp.TAN:
            return _tangent(first)
        case ArithmeticOp.ASIN:
            return _arc_sine(first)
        case ArithmeticOp.ACOS:
            return _arc_cosine(first)
        case ArithmeticOp.ATAN:
            return domain.loosen(np.arctan(first))
        case ArithmeticOp.ATAN2:
            return domain.wrap_angles(domain.angle_of(np.stack([domain.negative(first), last])))
        case ArithmeticOp.EXP:
            return _exponential(first)
        case ArithmeticOp.LOG:
            return _logarithm(first)
        case ArithmeticOp.FLOOR:
            return np.floor(first)
        case ArithmeticOp.CEIL:
            return np.ceil(first)
        case ArithmeticOp.WRAP:
            return domain.wrap_angles(first)


def arguments_of(op: ArithmeticOp, own: Enclosure, args: Sequence[Enclosure]) -> list[Enclosure]:
    """What each argument can have been; of those that are left out nothing is told.

    Args:
        op: The operation.
        own: The values that it has.
        args: What is known of the arguments.
    """
    first, last = args[0], args[-1]
    match op:
        case ArithmeticOp.ADD:
            return [reduce(domain.subtract, _others(args, at), own) for at in range(len(args))]
        case ArithmeticOp.SUB:
            return [domain.add(own, last), domain.subtract(first, own)]
        case ArithmeticOp.MUL:
            return [reduce(domain.divide, _others(args, at), own) for at in range(len(args))]
        case ArithmeticOp.DIV:
            return [domain.times(own, last), domain.divide(first, own)]
        case ArithmeticOp.POW:
            return _bases(own, first, last)
        case ArithmeticOp.NEG:
            return [domain.negative(own)]
        case ArithmeticOp.ABS:
            return [_mirrored(own, first)]
        case ArithmeticOp.MIN:
            return _at_least(own, args)
        case ArithmeticOp.MAX:
            return [domain.negative(each) for each in _at_least(domain.negative(own), [*map(domain.negative, args)])]
        case ArithmeticOp.SQRT:
            return [_whole_power(np.maximum(own, 0.0), 2)]
        case ArithmeticOp.SIN:
            near = domain.loosen(np.arcsin(np.clip(own, -1.0, 1.0)))
            return [_periodic(first, (near, math.pi - near[::-1]), math.tau)]
        case ArithmeticOp.COS:
            near = domain.loosen(np.arccos(np.clip(own, -1.0, 1.0))[::-1])
            return [_periodic(first, (near, domain.negative(near)), math.tau)]
        case ArithmeticOp.TAN:
            return [_periodic(first, (domain.loosen(np.arctan(own)),), math.pi)]
        case ArithmeticOp.ASIN:
            return [domain.turning(np.clip(own, -_QUARTER, _QUARTER))[0]]
        case ArithmeticOp.ACOS:
            return [domain.turning(np.clip(own, 0.0, math.pi))[1]]
        case ArithmeticOp.ATAN:
            return [_within_quarters(own)]
        case ArithmeticOp.ATAN2:
            aside, ahead = domain.cone(np.stack([domain.negative(first), last]), own)
            return [domain.negative(aside), ahead]
        case ArithmeticOp.EXP:
            return [domain.loosen(np.log(np.maximum(own, 0.0)))]
        case ArithmeticOp.LOG:
            return [_exponential(own)]
        case ArithmeticOp.FLOOR:
            return [np.stack([np.ceil(own[0]), np.floor(own[1]) + 1.0])]
        case ArithmeticOp.CEIL:
            return [np.stack([np.ceil(own[0]) - 1.0, np.floor(own[1])])]
        case ArithmeticOp.WRAP:
            return [domain.turns_near(own, first)]
        case ArithmeticOp.FLOORDIV | ArithmeticOp.MOD:
            return []


# --- up


def _unless(vague: NDArray[np.bool_], found: Enclosure) -> Enclosure:
    """Bounds, and everything where these are none."""
    return np.where(vague, domain.everything(found), found) if vague.any() else found


def _square_root(a: Enclosure) -> Enclosure:
    return _unless(a[1] < 0.0, np.maximum(domain.step_out(np.sqrt(np.maximum(a, 0.0))), 0.0))


def _exponential(a: Enclosure) -> Enclosure:
    return np.maximum(domain.stretch(np.exp(a)), 0.0)


def _logarithm(a: Enclosure) -> Enclosure:
    return _unless(a[1] <= 0.0, domain.loosen(np.log(np.maximum(a, 0.0))))


def _tangent(a: Enclosure) -> Enclosure:
    cosine = domain.turning(a)[1]
    # within one branch, where the cosine keeps its sign
    vague = (cosine[0] <= 0.0) & (cosine[1] >= 0.0)
    return _unless(vague, domain.loosen(np.tan(np.where(vague, 0.0, a))))


def _arc_sine(a: Enclosure) -> Enclosure:
    return _unless((a[0] > 1.0) | (a[1] < -1.0), domain.loosen(np.arcsin(np.clip(a, -1.0, 1.0))))


def _arc_cosine(a: Enclosure) -> Enclosure:
    return _unless((a[0] > 1.0) | (a[1] < -1.0), domain.loosen(np.arccos(np.clip(a, -1.0, 1.0))[::-1]))


def _power(a: Enclosure, exponent: Enclosure) -> Enclosure:
    number = float(exponent[0, 0])
    if not (exponent == number).all():
        # of a positive base; of another one a power may be anything
        return _unless(a[0] <= 0.0, _exponential(domain.times(exponent, _logarithm(a))))
    if number == int(number) and abs(number) <= _GREATEST_EXPONENT:
        whole = _whole_power(a, abs(int(number)))
        return whole if number >= 0 else domain.divide(np.broadcast_to(_ONE, whole.shape), whole)
    ends = np.power(np.maximum(a, 0.0)[:: 1 if number > 0 else -1], number)
    return _unless(a[1] < 0.0, np.maximum(domain.stretch(ends), 0.0))


def _whole_power(a: Enclosure, exponent: int) -> Enclosure:
    if exponent == 0:
        return np.ones_like(a)
    return domain.stretch(np.power(a if exponent % 2 else domain.magnitude(a), exponent))


def _remainder(a: Enclosure, b: Enclosure) -> Enclosure:
    turns = np.floor(domain.divide(a, b))
    # the rest has the sign of the divisor, and is smaller
    rest = np.stack([np.minimum(b[0], 0.0), np.maximum(b[1], 0.0)])
    known = (turns[0] == turns[1]) & np.isfinite(turns[0])
    return np.where(known, domain.common(rest, domain.subtract(a, domain.times(np.where(known, turns, 0.0), b))), rest)


# --- down


def _others(args: Sequence[Enclosure], at: int) -> list[Enclosure]:
    return [*args[:at], *args[at + 1 :]]


def _mirrored(own: Enclosure, a: Enclosure) -> Enclosure:
    """The arguments whose absolute value is within bounds."""
    low: NDArray[np.float64] = np.maximum(own[0], 0.0)
    high: NDArray[np.float64] = own[1]
    return np.stack([np.where(a[0] > -low, low, -high), np.where(a[1] < low, -low, high)])


def _at_least(own: Enclosure, args: Sequence[Enclosure]) -> list[Enclosure]:
    """What the arguments of a minimum can have been: whoever alone can be so small is."""
    found: list[Enclosure] = []
    for at in range(len(args)):
        alone = np.ones(own.shape[-1], dtype=bool)
        for other in _others(args, at):
            alone &= other[0] > own[1]
        found.append(np.stack([own[0], np.where(alone, own[1], np.inf)]))
    return found


def _periodic(a: Enclosure, branches: Sequence[Enclosure], period: float) -> Enclosure:
    """The hull of what is left of an interval within branches that come again after a period."""
    size = np.abs(a).max(axis=0)
    vague = ~(size < _FAR)
    safe = np.where(vague, 0.0, a)
    slack = 1e-14 * np.maximum(np.where(vague, 0.0, size), 1.0)
    lows = [each[0] + np.ceil((safe[0] - slack - each[1]) / period) * period for each in branches]
    highs = [each[1] + np.floor((safe[1] + slack - each[0]) / period) * period for each in branches]
    found = np.empty_like(safe)
    found[0], found[1] = np.min(lows, axis=0) - slack, np.max(highs, axis=0) + slack
    return np.where(vague, a, found)


def _within_quarters(own: Enclosure) -> Enclosure:
    """The tangents of angles; without an end where one is all but a quarter of a turn."""
    most = _QUARTER - ROUNDING
    ends = domain.loosen(np.tan(np.clip(own, -most, most)))
    ends[0, own[0] <= -most], ends[1, own[1] >= most] = -np.inf, np.inf
    return ends


def _bases(own: Enclosure, a: Enclosure, exponent: Enclosure) -> list[Enclosure]:
    """What the base of a power can have been, where its exponent is known."""
    number = float(exponent[0, 0])
    if not (exponent == number).all() or number == 0:
        return []
    if number < 0:
        own, number = domain.divide(np.broadcast_to(_ONE, own.shape), own), -number
    size: NDArray[np.float64] = np.power(np.abs(own), 1.0 / number)
    # the exponent is rounded, too
    found = np.copysign(size, own) if number % 2 == 1 else np.where(own < 0.0, 0.0, size)
    found = found + np.abs(found) * [[-_ROOT], [_ROOT]]
    return [_mirrored(found, a) if number % 2 == 0 else found]
