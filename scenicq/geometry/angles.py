"""Angles and headings: radians, heading 0 along +y, counter-clockwise."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "ALONG",
    "azimuth",
    "azimuth_array",
    "difference",
    "direction",
    "distance",
    "heading_of",
    "heading_of_array",
    "leads",
    "normalize",
    "normalize_array",
    "rotate",
    "rotate_array",
    "wrap",
    "wrap_array",
]

_TURN = 2 * math.pi
ALONG = math.radians(60)
"""How far a lane may lead from the heading of who is in it for it to be one of its own, where several are there."""


def leads(ways: Iterable[float], heading: float) -> bool:
    """Whether one of the directions of a lane is that of who goes there."""
    return any(abs(math.remainder(way - heading, _TURN)) <= ALONG for way in ways)


def normalize(angle: float) -> float:
    """The angle in (-pi, pi] that differs from the given one by whole turns.

    `math.remainder` is exact, so no turn is lost to rounding; only its lower end needs moving.
    """
    wrapped = math.remainder(angle, _TURN)
    return math.pi if wrapped <= -math.pi else wrapped


def normalize_array(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """`normalize` of every angle of an array of any shape."""
    # fmod is exact, and subtracting a turn from what lies within two of it is exact too
    wrapped = np.fmod(angles, _TURN)
    wrapped = np.where(wrapped > math.pi, wrapped - _TURN, wrapped)
    return np.where(wrapped <= -math.pi, wrapped + _TURN, wrapped)


def wrap(angle: float) -> float:
    """The angle in [-pi, pi] that differs by whole turns; half a turn keeps its sign, as in Scenic."""
    wrapped = math.remainder(angle, _TURN)
    return math.copysign(wrapped, angle) if abs(wrapped) == math.pi else wrapped


def wrap_array(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """`wrap` of every angle of an array of any shape."""
    wrapped = np.fmod(angles, _TURN)
    return np.where(wrapped > math.pi, wrapped - _TURN, np.where(wrapped < -math.pi, wrapped + _TURN, wrapped))


def difference(a: float, b: float) -> float:
    """The signed smallest turn from b to a, in (-pi, pi]."""
    return normalize(a - b)


def distance(a: float, b: float) -> float:
    """How far two angles are apart, in [0, pi]."""
    return abs(normalize(a - b))


def heading_of(dx: float, dy: float) -> float:
    """The heading in (-pi, pi] of a direction; -pi/2 for the null vector, as Scenic's."""
    if dx == 0 and dy == 0:
        return -math.pi / 2
    heading = math.atan2(-dx, dy)
    return math.pi if heading == -math.pi else heading


def heading_of_array(dx: NDArray[np.float64], dy: NDArray[np.float64]) -> NDArray[np.float64]:
    """`heading_of` of every direction of two arrays of one shape."""
    # NumPy's function rounds as the machine and its version do, and a dataset is the same wherever it is made
    pairs = np.broadcast_arrays(-dx, dy)
    each = [*map(math.atan2, *(side.ravel().tolist() for side in pairs))]
    headings = np.array(each, dtype=np.float64).reshape(pairs[0].shape)
    return np.where((dx == 0) & (dy == 0), -math.pi / 2, np.where(headings == -math.pi, math.pi, headings))


def azimuth(dx: float, dy: float) -> float:
    """The heading in [-pi, pi) of a line of sight, at its ends as Scenic's."""
    heading = heading_of(dx, dy)
    return -math.pi if heading == math.pi else heading


def azimuth_array(dx: NDArray[np.float64], dy: NDArray[np.float64]) -> NDArray[np.float64]:
    """`azimuth` of every line of sight of two arrays of one shape."""
    headings = heading_of_array(dx, dy)
    return np.where(headings == math.pi, -math.pi, headings)


def direction(heading: float) -> tuple[float, float]:
    """The unit vector that points along a heading."""
    return -math.sin(heading), math.cos(heading)


def rotate(x: float, y: float, angle: float) -> tuple[float, float]:
    """The vector turned counter-clockwise by an angle."""
    cos, sin = math.cos(angle), math.sin(angle)
    return x * cos - y * sin, x * sin + y * cos


def rotate_array(xy: NDArray[np.float64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """`rotate` of vectors (n, 2) by angles (n,)."""
    cos, sin = np.cos(angles), np.sin(angles)
    return np.column_stack([xy[:, 0] * cos - xy[:, 1] * sin, xy[:, 0] * sin + xy[:, 1] * cos])
