"""Intervals and boxes as arrays: outer bounds of the same expression in many cases at once.

An interval is an array (2, n) of lower and upper ends, a box an array (2, 2, n): coordinate, end, case. The functions
take either where that makes sense. They are rounded outwards: a result holds the exact value, and the one that floating
point gives, for all numbers within the arguments (`tests/units/match/fields/test_outward_rounding.py`), so that what
is empty has no solution. Sums, products and quotients are off by half a unit in the last place, which one step outwards
makes up for; functions of the C library and of NumPy are off by less than `LIBRARY`.

For cases of one correspondence, in which everything is random: all arrays have one length and are inverted as well
(`contractor`). For candidates of roles, where most values are known numbers that must stay exact and
arrays of different axes broadcast, see `forest/intervals`.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from scenicq.match.tolerance import ROUNDING

__all__ = [
    "HALF_TURNS",
    "Enclosure",
    "add",
    "angle_of",
    "common",
    "cone",
    "divide",
    "everything",
    "find_empty",
    "lengths",
    "loosen",
    "magnitude",
    "negative",
    "rotate",
    "step_out",
    "stretch",
    "subtract",
    "times",
    "turning",
    "turns_near",
    "wrap_angles",
]

Enclosure: TypeAlias = NDArray[np.float64]

LIBRARY = 4e-15
"""More than the error of functions of the C library and of NumPy: relative, and absolute below 1."""
HALF_TURNS: Enclosure = np.array([[-math.pi - LIBRARY], [math.pi + LIBRARY]])
"""Angles that are wrapped."""
_OUTWARDS = np.array([[-np.inf], [np.inf]])
_LOOSER = np.array([[-LIBRARY], [LIBRARY]])
_CRESTS = np.array([[math.pi / 2], [0.0]])
"""Where a sine and a cosine are greatest."""
_FAR = 1e6
"""Radians beyond which an angle may be any: the error of whole turns grows with them."""


def everything(like: Enclosure) -> Enclosure:
    """All numbers, in the shape of another enclosure."""
    found = np.empty_like(like)
    found[..., 0, :], found[..., 1, :] = -np.inf, np.inf
    return found


def step_out(a: Enclosure) -> Enclosure:
    """Both ends one number further out."""
    return np.nextafter(a, _OUTWARDS)


def loosen(a: Enclosure) -> Enclosure:
    """Both ends further out by what a function that gives them is off, in absolute terms below 1."""
    return step_out(a) + _LOOSER * np.maximum(np.abs(a), 1.0)


def stretch(a: Enclosure) -> Enclosure:
    """Both ends further out by what a function that gives them is off, in relative terms however small they are."""
    found = step_out(a)
    return step_out(found + _LOOSER * np.abs(found))


def negative(a: Enclosure) -> Enclosure:
    """The same below zero."""
    return -a[..., ::-1, :]


def magnitude(a: Enclosure) -> Enclosure:
    """The absolute value."""
    low, high = a[..., 0, :], a[..., 1, :]
    return np.stack([np.maximum(np.maximum(low, -high), 0.0), np.maximum(-low, high)], axis=-2)


def add(a: Enclosure, b: Enclosure) -> Enclosure:
    """The sum."""
    return step_out(a + b)


def subtract(a: Enclosure, b: Enclosure) -> Enclosure:
    """The difference."""
    return step_out(a - b[..., ::-1, :])


def times(a: Enclosure, b: Enclosure) -> Enclosure:
    """The product; nothing times an infinite end is nothing."""
    with np.errstate(invalid="ignore"):
        return _hull(a[..., :, None, :] * b[..., None, :, :])


def divide(a: Enclosure, b: Enclosure) -> Enclosure:
    """Every number that times the divisor can give the dividend: the quotient; all where both may be zero."""
    low, high = b[..., 0, :], b[..., 1, :]
    vague = (low <= 0.0) & (high >= 0.0)
    if not vague.any():
        return _hull(a[..., :, None, :] / b[..., None, :, :])
    # an end that is zero is met from inside
    ends = np.stack([np.where(low == 0.0, 0.0, low), np.where(high == 0.0, -0.0, high)], axis=-2)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        found = _hull(a[..., :, None, :] / ends[..., None, :, :])
    both = (a[..., 0, :] <= 0.0) & (a[..., 1, :] >= 0.0)
    vague = vague & (both | ((low < 0.0) & (high > 0.0)))
    return np.where(vague[..., None, :], everything(found), found)


def _hull(ends: NDArray[np.float64]) -> Enclosure:
    """The least and the greatest of the four results (..., 2, 2, n) of ends, of which none is nothing."""
    vague = np.isnan(ends)
    if vague.any():
        ends[vague] = 0.0
    found = np.empty(ends.shape[:-3] + ends.shape[-2:])
    np.minimum.reduce(ends, axis=(-3, -2), out=found[..., 0, :])
    np.maximum.reduce(ends, axis=(-3, -2), out=found[..., 1, :])
    return step_out(found)


def common(a: Enclosure, b: Enclosure) -> Enclosure:
    """What two have in common; an end that is no number bounds nothing."""
    low, high = np.fmax(a[..., 0, :], b[..., 0, :]), np.fmin(a[..., 1, :], b[..., 1, :])
    found = np.empty((*low.shape[:-1], 2, low.shape[-1]))
    found[..., 0, :], found[..., 1, :] = low, high
    return found


def find_empty(a: Enclosure) -> NDArray[np.bool_]:
    """In which cases an enclosure is empty, (n,)."""
    empty = a[..., 0, :] > a[..., 1, :]
    return np.logical_or.reduce(np.atleast_2d(empty), axis=0)


def turning(angle: Enclosure) -> Enclosure:
    """The sine and the cosine of angles, (2, 2, n)."""
    low, high = angle
    size = np.maximum(np.abs(low), np.abs(high))
    wide = ~((high - low < math.tau) & (size < _FAR))
    safe = np.where(wide, 0.0, angle)
    low, high = safe
    values = np.stack([np.sin(safe), np.cos(safe)])
    slack = LIBRARY * np.maximum(np.where(wide, 0.0, size), 1.0)
    first, last = low - slack, high + slack
    top = wide | (np.ceil((first - _CRESTS) / math.tau) * math.tau + _CRESTS <= last)
    crests = _CRESTS - math.pi
    bottom = wide | (np.ceil((first - crests) / math.tau) * math.tau + crests <= last)
    found = np.empty((2, 2, angle.shape[-1]))
    found[:, 0] = np.where(bottom, -1.0, np.maximum(values.min(axis=1) - LIBRARY, -1.0))
    found[:, 1] = np.where(top, 1.0, np.minimum(values.max(axis=1) + LIBRARY, 1.0))
    return found


def rotate(box: Enclosure, turn: Enclosure) -> Enclosure:
    """Boxes turned counter-clockwise by the angles of a sine and a cosine."""
    # both coordinates times both at once: what a call costs counts most where there are few cases
    parts = times(box[:, None], turn)
    found = np.stack([parts[0, 1] - parts[1, 0, ::-1], parts[0, 0] + parts[1, 1]])
    reach = np.hypot(*np.abs(box).max(axis=1)) * (1.0 + LIBRARY)
    return common(step_out(found), np.stack([-reach, reach]))


def lengths(box: Enclosure) -> Enclosure:
    """The lengths of the vectors of boxes, as intervals."""
    ends = magnitude(box)
    return np.maximum(stretch(np.hypot(ends[0], ends[1])), 0.0)


def angle_of(box: Enclosure) -> Enclosure:
    """The headings of the vectors of boxes, counter-clockwise from ahead; everything where they may be all."""
    around = (box[:, 0] <= 0).all(axis=0) & (box[:, 1] >= 0).all(axis=0)
    vague = around | ~np.isfinite(box).all(axis=(0, 1))
    safe = np.where(vague, 1.0, box)
    center = safe[:, 0] / 2 + safe[:, 1] / 2
    middle = np.arctan2(-center[0], center[1])
    corners = np.arctan2(-safe[0][:, None], safe[1][None, :])
    # seen from outside, a box covers less than half a turn; rounding tells no more on which side where it is almost one
    off = np.remainder(corners - middle + math.pi, math.tau) - math.pi
    vague |= (np.abs(off) > math.pi - ROUNDING).any(axis=(0, 1))
    found = middle + np.stack([off.min(axis=(0, 1)), off.max(axis=(0, 1))])
    # rounded several times, each time as numbers of one turn are
    return np.where(vague, everything(found), found + 4 * _LOOSER)


def cone(box: Enclosure, heading: Enclosure) -> Enclosure:
    """Where the vectors of boxes are that have headings within bounds: aside by their length, and by what is ahead."""
    sine, cosine = turning(heading)
    by_length = times(lengths(box), np.stack([negative(sine), cosine]))
    # x cos = -y sin
    by_other = divide(times(negative(box[::-1]), np.stack([sine, cosine])), np.stack([cosine, sine]))
    return common(by_length, by_other)


def wrap_angles(angles: Enclosure) -> Enclosure:
    """Angles in [-pi, pi]; all of these where the ends are not of one turn."""
    middle = (angles[0] + angles[1]) / 2
    found = angles - math.tau * np.round(np.where(np.isfinite(middle), middle / math.tau, 0.0))
    # straight behind is either end: which one is a matter of rounding, and of whose formula is taken
    inside = (found[0] > -math.pi + ROUNDING) & (found[1] < math.pi - ROUNDING) & (np.abs(middle) < _FAR)
    return np.where(inside, found + _LOOSER * np.maximum(np.abs(middle), 1.0), HALF_TURNS)


def turns_near(a: Enclosure, within: Enclosure) -> Enclosure:
    """The hull of angles plus whole turns, as far as they meet intervals; what cannot be told stays as it is."""
    vague = ~((np.abs(a) < _FAR).all(axis=0) & (np.abs(within) < _FAR).all(axis=0))
    a, safe = np.where(vague, 0.0, a), np.where(vague, 0.0, within)
    first = np.ceil((safe[0] - a[1]) / math.tau - ROUNDING)
    last = np.floor((safe[1] - a[0]) / math.tau + ROUNDING)
    near = a + math.tau * np.stack([first, last]) + _LOOSER * np.maximum(np.abs(safe).max(axis=0), 1.0)
    found = np.where(last < first, [[np.inf], [-np.inf]], near)
    return np.where(vague, within, found)
