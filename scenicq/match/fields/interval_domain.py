"""Intervals and boxes as arrays: outer bounds of the same expression in many cases at once.

An interval is an array (2, n) of lower and upper ends, a box an array (2, 2, n): coordinate, end, case. The functions
take either where that makes sense, and never return too little.

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
    "Enclosure",
    "angle_of",
    "common",
    "divide",
    "everything",
    "lengths",
    "negative",
    "nothing_left",
    "rotate",
    "subtract",
    "times",
    "turning",
    "turns_near",
    "wrapped",
]

Enclosure: TypeAlias = NDArray[np.float64]


def everything(like: Enclosure) -> Enclosure:
    """All numbers, in the shape of another enclosure."""
    found = np.empty_like(like)
    found[..., 0, :], found[..., 1, :] = -np.inf, np.inf
    return found


def negative(a: Enclosure) -> Enclosure:
    """The same below zero."""
    return -a[..., ::-1, :]


def subtract(a: Enclosure, b: Enclosure) -> Enclosure:
    """The difference."""
    return a - b[..., ::-1, :]


def times(a: Enclosure, b: Enclosure) -> Enclosure:
    """The product; nothing times an infinite end is nothing."""
    with np.errstate(invalid="ignore"):
        ends = a[..., :, None, :] * b[..., None, :, :]
    vague = np.isnan(ends)
    if vague.any():
        ends[vague] = 0.0
    found = np.empty(ends.shape[:-3] + ends.shape[-2:])
    np.minimum.reduce(ends, axis=(-3, -2), out=found[..., 0, :])
    np.maximum.reduce(ends, axis=(-3, -2), out=found[..., 1, :])
    return found


def divide(a: Enclosure, b: Enclosure) -> Enclosure:
    """The quotient; everything where the divisor may be close to zero."""
    vague = (b[..., 0, :] <= ROUNDING) & (b[..., 1, :] >= -ROUNDING)
    safe = np.where(vague[..., None, :], 1.0, b)
    found = times(a, 1.0 / safe[..., ::-1, :])
    return np.where(vague[..., None, :], everything(found), found)


def common(a: Enclosure, b: Enclosure) -> Enclosure:
    """What two have in common; ends that miss each other by rounding alone change places."""
    low, high = np.maximum(a[..., 0, :], b[..., 0, :]), np.minimum(a[..., 1, :], b[..., 1, :])
    found = np.empty((*low.shape[:-1], 2, low.shape[-1]))
    found[..., 0, :], found[..., 1, :] = low, high
    crossed = low > high
    if crossed.any():
        swap = crossed & (low <= high + ROUNDING)
        found[..., 0, :][swap], found[..., 1, :][swap] = high[swap], low[swap]
    return found


def nothing_left(a: Enclosure) -> NDArray[np.bool_]:
    """In which cases an enclosure is empty, (n,)."""
    empty = a[..., 0, :] > a[..., 1, :]
    return np.logical_or.reduce(np.atleast_2d(empty), axis=0)


def _sine(a: Enclosure) -> Enclosure:
    low, high = a[..., 0, :], a[..., 1, :]
    wide = ~(high - low < math.tau)
    low, high = np.where(wide, 0.0, low), np.where(wide, 0.0, high)
    ends = np.sin(np.stack([low, high]))
    quarter = math.pi / 2
    top = wide | (np.ceil((low - quarter) / math.tau) * math.tau + quarter <= high)
    bottom = wide | (np.ceil((low + quarter) / math.tau) * math.tau - quarter <= high)
    return np.stack([np.where(bottom, -1.0, ends.min(axis=0)), np.where(top, 1.0, ends.max(axis=0))], axis=-2)


def turning(angle: Enclosure) -> Enclosure:
    """The sine and the cosine of angles, (2, 2, n)."""
    return _sine(np.stack([angle, angle + math.pi / 2]))


def rotate(box: Enclosure, turn: Enclosure) -> Enclosure:
    """Boxes turned counter-clockwise by the angles of a sine and a cosine."""
    # both coordinates times both at once: what a call costs counts most where there are few cases
    parts = times(box[:, None], turn)
    across, along = subtract(parts[0, 1], parts[1, 0]), parts[0, 0] + parts[1, 1]
    reach = np.hypot(*np.abs(box).max(axis=1))
    return common(np.stack([across, along]), np.stack([-reach, reach]))


def lengths(box: Enclosure) -> Enclosure:
    """The lengths of the vectors of boxes, as intervals."""
    low, high = box[:, 0], box[:, 1]
    near = np.maximum(np.maximum(low, -high), 0.0)
    return np.stack([np.hypot(*near), np.hypot(*np.maximum(-low, high))])


def angle_of(box: Enclosure) -> Enclosure:
    """The headings of the vectors of boxes, counter-clockwise from ahead; everything where they may be all."""
    around = (box[:, 0] <= 0).all(axis=0) & (box[:, 1] >= 0).all(axis=0)
    vague = around | ~np.isfinite(box).all(axis=(0, 1))
    safe = np.where(vague, 1.0, box)
    middle = np.arctan2(-safe[0].mean(axis=0), safe[1].mean(axis=0))
    corners = np.arctan2(-safe[0][:, None], safe[1][None, :])
    # seen from outside, a box covers less than half a turn
    off = np.remainder(corners - middle + math.pi, math.tau) - math.pi
    found = middle + np.stack([off.min(axis=(0, 1)), off.max(axis=(0, 1))])
    return np.where(vague, everything(found), found)


def wrapped(angles: Enclosure) -> Enclosure:
    """Angles in (-pi, pi]; all of these where the ends are not of one turn."""
    middle = (angles[0] + angles[1]) / 2
    found = angles - math.tau * np.round(np.where(np.isfinite(middle), middle / math.tau, 0.0))
    # straight behind is either end: which one is a matter of rounding, and of whose formula is taken
    inside = (found[0] > -math.pi + ROUNDING) & (found[1] < math.pi - ROUNDING)
    return np.where(inside, found, [[-math.pi], [math.pi]])


def turns_near(a: Enclosure, within: Enclosure) -> Enclosure:
    """The hull of angles plus whole turns, as far as they meet intervals; what cannot be told stays as it is."""
    vague = ~(np.isfinite(a).all(axis=0) & np.isfinite(within).all(axis=0))
    a, safe = np.where(vague, 0.0, a), np.where(vague, 0.0, within)
    first = np.ceil((safe[0] - a[1]) / math.tau - ROUNDING)
    last = np.floor((safe[1] - a[0]) / math.tau + ROUNDING)
    found = np.where(last < first, [[np.inf], [-np.inf]], a + math.tau * np.stack([first, last]))
    return np.where(vague, within, found)
