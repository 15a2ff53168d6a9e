"""Distances from points to discs, sectors and rectangles, where points and shapes are arrays that broadcast.

The formulas are those of `membership.distance`, for many points and many shapes at once.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias, cast

import numpy as np

__all__ = ["to_discs", "to_rectangles", "to_sectors"]

_Numbers: TypeAlias = Any
"""A float, or an array of floats that broadcasts with the others."""


def _turned(x: _Numbers, y: _Numbers, angle: _Numbers) -> tuple[_Numbers, _Numbers]:
    cos, sin = np.cos(angle), np.sin(angle)
    return x * cos - y * sin, x * sin + y * cos


def to_discs(dx: _Numbers, dy: _Numbers, radius: _Numbers) -> _Numbers:
    """Distances to discs in metres, inf to those of negative radius.

    Args:
        dx: The points, seen from the centres, metres.
        dy: Likewise.
        radius: Metres.
    """
    return np.where(np.less(radius, 0), np.inf, np.maximum(np.hypot(dx, dy) - radius, 0.0))


def to_sectors(dx: _Numbers, dy: _Numbers, radius: _Numbers, heading: _Numbers, angle: _Numbers) -> _Numbers:
    """Distances to sectors in metres, inf to those of negative radius.

    Args:
        dx: The points, seen from the centres, metres.
        dy: Likewise.
        radius: Metres.
        heading: Of the middle, radians.
        angle: Between the sides, radians.
    """
    aside, ahead = _turned(dx, dy, np.negative(heading))
    aside = np.abs(aside)
    half = np.maximum(angle, 0.0) / 2
    within = (half >= math.pi) | (np.arctan2(aside, ahead) <= half)
    east, north = np.sin(half), np.cos(half)
    along = np.minimum(np.maximum(aside * east + ahead * north, 0.0), radius)
    to_side = np.hypot(aside - along * east, ahead - along * north)
    return np.where(
        np.less(radius, 0), np.inf, cast(_Numbers, np.where(within, to_discs(aside, ahead, radius), to_side))
    )


def to_rectangles(dx: _Numbers, dy: _Numbers, heading: _Numbers, width: _Numbers, length: _Numbers) -> _Numbers:
    """Distances to rectangles in metres.

    Args:
        dx: The points, seen from the centres, metres.
        dy: Likewise.
        heading: Radians.
        width: Metres.
        length: Metres.
    """
    aside, ahead = _turned(dx, dy, np.negative(heading))
    return np.hypot(
        np.maximum(np.abs(aside) - np.divide(width, 2), 0.0), np.maximum(np.abs(ahead) - np.divide(length, 2), 0.0)
    )
