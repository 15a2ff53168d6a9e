"""Conditions under which a vector field has the heading of a cell that covers too much.

Which centreline segment is nearest is decided along parabolas, which no convex cell follows. A cell that such a border
crosses keeps both sides and says by guards which points are meant: so the matcher can cut the cell down to the side it
wants, and a formula can state the border as it is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias, assert_never

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry import shapes
from scenicq.geometry.shapes import Bounds, Shape

__all__ = [
    "Guard",
    "HalfPlane",
    "NearestSegment",
    "OutsidePolygon",
    "Within",
    "half_planes",
    "narrow_guards",
    "segment_distances",
]

_ROUNDING = 1e-7
"""Metres that a comparison of distances may be off before it excludes a point."""
_LEAST = float(np.finfo(float).tiny)
"""What a squared length is divided by at least."""

Segments: TypeAlias = NDArray[np.float64]
"""Rows x0, y0, x1, y1 in metres, shape (n, 4)."""


@dataclass(frozen=True, slots=True, eq=False)
class NearestSegment:
    """One of a cell's own segments is at least as near as every rival.

    Attributes:
        own: Segments, at least one.
        rivals: Segments, at least one.
    """

    own: Segments
    rivals: Segments


@dataclass(frozen=True, slots=True, eq=False)
class OutsidePolygon:
    """The point lies outside of a polygon, or on its border."""

    area: Shape


@dataclass(frozen=True, slots=True, eq=False)
class Within:
    """One of some segments is no farther away than a distance in metres."""

    own: Segments
    reach: float


Guard: TypeAlias = NearestSegment | OutsidePolygon | Within

HalfPlane: TypeAlias = tuple[float, float, float]
"""The points with a x + b y <= c, from a, b and c, in metres."""


def segment_distances(xy: NDArray[np.float64], segments: Segments) -> NDArray[np.float64]:
    """Distances from points (..., 2) to segments (..., 4), broadcast together."""
    # coordinate by coordinate: sums over an axis of two take most of the time where there are few points
    x, y, from_x, from_y = xy[..., 0], xy[..., 1], segments[..., 0], segments[..., 1]
    along_x, along_y = segments[..., 2] - from_x, segments[..., 3] - from_y
    squares = np.maximum(along_x * along_x + along_y * along_y, _LEAST)
    share = ((x - from_x) * along_x + (y - from_y) * along_y) / squares
    share = np.minimum(np.maximum(share, 0.0), 1.0)
    return np.hypot(x - (from_x + share * along_x), y - (from_y + share * along_y))


def narrow_guards(guards: Sequence[Guard], bounds: Bounds) -> tuple[Guard, ...] | None:
    """What guards still demand of the points of a box.

    Args:
        guards: Conditions that hold together.
        bounds: The box.

    Returns:
        The guards that not all of the box satisfies, cut down to the segments that matter there; None where no point of
        the box satisfies all of them.
    """
    west, south, east, north = bounds
    middle = np.array([(west + east) / 2, (south + north) / 2])
    reach = math.hypot(east - west, north - south) / 2
    left: list[Guard] = []
    for guard in guards:
        found = _narrowed(guard, bounds, middle, reach)
        if found is False:
            return None
        if found is not True:
            left.append(found)
    return tuple(left)


def half_planes(guards: Sequence[Guard], bounds: Bounds) -> list[HalfPlane]:
    """Half planes that hold every point of a box that satisfies all guards; the smaller the box, the closer.

    A distance to a segment is convex, so nowhere less than its tangent plane, and of what it exceeds that by the most
    is found at a corner. Guards in which a point may be near to any of several segments are passed over.
    """
    west, south, east, north = bounds
    places = np.array([(west, south), (east, south), (east, north), (west, north)])
    middle = places.mean(axis=0)
    found: list[HalfPlane] = []
    for guard in guards:
        if isinstance(guard, OutsidePolygon) or len(guard.own) > 1:
            continue
        (own,), (slope,) = _tangents(middle, guard.own)
        rivals = guard.rivals if isinstance(guard, NearestSegment) else np.empty((0, 4))
        away, slopes = _tangents(middle, rivals)
        over = segment_distances(places[:, None], rivals) - away - (places - middle) @ slopes.T
        limits = away - own + over.max(axis=0, initial=0.0)
        normals = slope - slopes
        if isinstance(guard, Within):
            limits, normals = np.array([guard.reach - own]), slope[None]
        limits = limits + normals @ middle + _ROUNDING
        found += zip(*normals.T.tolist(), limits.tolist(), strict=True)
    return found


def _tangents(xy: NDArray[np.float64], segments: Segments) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distances (n,) from a point to segments (n, 4), and the slopes (n, 2) of planes that touch them from below."""
    start, along = segments[:, :2], segments[:, 2:] - segments[:, :2]
    share = ((xy - start) * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), _LEAST)
    off = xy - start - np.clip(share, 0.0, 1.0)[:, None] * along
    away = np.hypot(off[:, 0], off[:, 1])
    return away, off / np.maximum(away, _LEAST)[:, None]


def _box(bounds: Bounds) -> Shape:
    west, south, east, north = bounds
    return shapes.box(*bounds) if west < east and south < north else shapes.line([(west, south), (east, north)])


def _narrowed(guard: Guard, bounds: Bounds, middle: NDArray[np.float64], reach: float) -> Guard | bool:
    """What is left of a guard for points within a reach of the middle; whether it holds if that is decided."""
    match guard:
        case NearestSegment():
            return _nearer(guard, middle, reach)
        case OutsidePolygon():
            box = _box(bounds)
            if shapes.distance(guard.area, box) > _ROUNDING:
                return True
            return False if shapes.covers(guard.area, box) else guard
        case Within():
            away = segment_distances(middle, guard.own)
            if away.min() + reach <= guard.reach:
                return True
            near = away <= guard.reach + reach + _ROUNDING
            return Within(guard.own[near], guard.reach) if near.any() else False
        case _:
            assert_never(guard)


def _nearer(guard: NearestSegment, middle: NDArray[np.float64], reach: float) -> Guard | bool:
    own, rivals = segment_distances(middle, guard.own), segment_distances(middle, guard.rivals)
    # distances change by no more than the way: what is farther than this can be nearest nowhere in the box
    limit = 2 * reach + _ROUNDING
    if own.min() > rivals.min() + limit:
        return False
    if own.min() + 2 * reach <= rivals.min():
        return True
    return NearestSegment(guard.own[own <= own.min() + limit], guard.rivals[rivals <= rivals.min() + limit])
