"""Arithmetic of intervals and of boxes turned by an interval of angles: outer bounds, with no division by zero."""

from __future__ import annotations

import math
from typing import TypeVar, cast

from scenicq.forest.bounds import EVERYTHING, Box, Interval, add, multiply

__all__ = [
    "angle_of",
    "common",
    "divide",
    "empty",
    "grown",
    "near_turn",
    "negative",
    "rotate",
    "subtract",
    "turned",
]

_Span = TypeVar("_Span", Interval, Box)
_ROUNDING = 1e-9
"""By how much two intervals may miss each other and still meet."""


def subtract(a: Interval, b: Interval) -> Interval:
    """The difference."""
    return (a[0] - b[1], a[1] - b[0])


def negative(a: Interval) -> Interval:
    """The same below zero."""
    return (-a[1], -a[0])


def divide(a: Interval, b: Interval) -> Interval:
    """The quotient; everything where the divisor may be close to zero."""
    if b[0] <= _ROUNDING and b[1] >= -_ROUNDING:
        return EVERYTHING
    return multiply(a, (1 / b[1], 1 / b[0]))


def _common(a: Interval, b: Interval) -> Interval:
    low, high = max(a[0], b[0]), min(a[1], b[1])
    # what meets but for rounding is one point
    return (low, high) if low <= high or low > high + _ROUNDING else (high, low)


def common(a: _Span, b: _Span) -> _Span:
    """What two of a kind have in common."""
    if isinstance(a[0], tuple):
        (ax, ay), (bx, by) = cast(Box, a), cast(Box, b)
        return cast(_Span, (_common(ax, bx), _common(ay, by)))
    return cast(_Span, _common(cast(Interval, a), cast(Interval, b)))


def empty(a: Interval | Box) -> bool:
    """Whether nothing is left."""
    if isinstance(a[0], tuple):
        return any(low > high for low, high in cast(Box, a))
    low, high = cast(Interval, a)
    return low > high


def grown(a: Box, by: float) -> Box:
    """A box with a margin."""
    (x0, x1), (y0, y1) = a
    return (x0 - by, x1 + by), (y0 - by, y1 + by)


def turned(a: Interval, onto: Interval) -> Interval:
    """An angle brought into one turn by whole turns: as it is where it lies there, else all of the turn."""
    if onto[0] < a[0] and a[1] <= onto[1]:
        return a
    turns = math.tau * round((a[0] + a[1]) / 2 / math.tau) if all(map(math.isfinite, a)) else 0.0
    low, high = a[0] - turns, a[1] - turns
    return (low, high) if onto[0] < low and high <= onto[1] else onto


def near_turn(a: Interval, within: Interval) -> Interval:
    """The hull of an angle plus whole turns, as far as it meets an interval; what does not meet it stays as it is."""
    if not all(map(math.isfinite, (*a, *within))):
        return within
    first = math.ceil((within[0] - a[1]) / math.tau - _ROUNDING)
    last = math.floor((within[1] - a[0]) / math.tau + _ROUNDING)
    if last < first:
        return (math.inf, -math.inf)
    return (a[0] + math.tau * first, a[1] + math.tau * last)


def _sine(a: Interval) -> Interval:
    low, high = a
    if not (math.isfinite(low) and math.isfinite(high)) or high - low >= math.tau:
        return (-1.0, 1.0)
    ends = (math.sin(low), math.sin(high))
    top = math.ceil((low - math.pi / 2) / math.tau) * math.tau + math.pi / 2 <= high
    bottom = math.ceil((low + math.pi / 2) / math.tau) * math.tau - math.pi / 2 <= high
    return (-1.0 if bottom else min(ends), 1.0 if top else max(ends))


def rotate(box: Box, angle: Interval) -> Box:
    """A box turned by an angle."""
    x, y = box
    if not all(map(math.isfinite, (*x, *y))):
        return (EVERYTHING, EVERYTHING)
    s, c = _sine(angle), _sine((angle[0] + math.pi / 2, angle[1] + math.pi / 2))
    reach = math.hypot(max(map(abs, x)), max(map(abs, y)))
    disc = (-reach, reach)
    across = subtract(multiply(x, c), multiply(y, s))
    along = add(multiply(x, s), multiply(y, c))
    return (_common(across, disc), _common(along, disc))


def angle_of(box: Box) -> Interval | None:
    """The headings of the vectors of a box, counter-clockwise from ahead; None where they may be all."""
    (x0, x1), (y0, y1) = box
    if not all(map(math.isfinite, (x0, x1, y0, y1))) or (x0 <= 0 <= x1 and y0 <= 0 <= y1):
        return None
    middle = math.atan2(-(x0 + x1) / 2, (y0 + y1) / 2)
    # seen from outside, a box covers less than half a turn
    off = [math.remainder(math.atan2(-x, y) - middle, math.tau) for x in (x0, x1) for y in (y0, y1)]
    return (middle + min(off), middle + max(off))
