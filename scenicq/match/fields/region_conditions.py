"""Whether a condition on regions may hold, or fail, anywhere in a case: for many cases at once.

A random point, disc or rectangle is the one in the middle of its case, and no point of it is farther from there than
the case allows. So the smaller a case is, the less is left open of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.nodes import Contains, DiscAt, Encloses, Intersects, Node, RectangleAt, SectorAt
from scenicq.geometry import shapes
from scenicq.geometry.angles import normalize_array
from scenicq.geometry.boxes import box_polygons
from scenicq.geometry.containment import SLIVER, missed_areas, surely_covers_many
from scenicq.geometry.membership import may_be_within
from scenicq.geometry.proximity import meets_many
from scenicq.geometry.regions import PolygonSet, Region
from scenicq.match.fields import interval_domain as domain
from scenicq.match.fields.region_bounds import Bounds, known_region, middles
from scenicq.match.tolerance import SLACK

__all__ = ["RegionCondition", "may_be"]

RegionCondition = Contains | Intersects | Encloses

_Mask = NDArray[np.bool_]
_Numbers = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Shapes:
    """A random shape, case by case.

    Attributes:
        middle: The shapes in the middle of the cases, (n,).
        off: How far a point of one can be from its nearest in the middle, and the other way round, in metres.
        inner: What is part of the shape anywhere in the case; None where nothing is known to be.
        inner_radius: All within so many metres of that is part of it, too.
        outer: What holds all of a point or rectangle anywhere in the case.
    """

    middle: NDArray[np.object_]
    off: _Numbers
    inner: NDArray[np.object_]
    inner_radius: _Numbers
    outer: NDArray[np.object_]


def may_be(node: RegionCondition, wanted: bool, vector: Bounds, scalar: Bounds) -> _Mask | None:
    """In which cases a condition may hold, or fail, (n,); None where that is not known.

    Args:
        node: The condition.
        wanted: Whether it should hold.
        vector: The bounds of a point, (2, 2, n).
        scalar: The bounds of a number, (2, n).
    """
    match node:
        case Contains():
            one, other = _side(node.region, vector, scalar), _points(vector(node.point))
        case Intersects():
            one, other = _side(node.left, vector, scalar), _side(node.right, vector, scalar)
            if isinstance(one, _Shapes):
                one, other = other, one
        case Encloses():
            one = known_region(node.outer)
            other = _rectangles(node.inner, vector, scalar) if isinstance(node.inner, RectangleAt) else None
    if one is None or not isinstance(other, _Shapes):
        return None
    known = np.isfinite(other.off) & (np.isfinite(one.off) if isinstance(one, _Shapes) else True)
    found, some = np.ones(len(known), dtype=bool), np.flatnonzero(known)
    if isinstance(one, _Shapes):
        found[some] = _may_meet(one, other, some) if wanted else ~_must(node, one, other, some)
    elif isinstance(node, Encloses):
        found[some] = _may_enclose(one, other, some, wanted=wanted)
    elif wanted:
        found[some] = meets_many(one, other.middle[some], other.off[some] + SLACK)
    elif isinstance(node, Contains):
        found[some] = ~surely_covers_many(one, other.outer[some])
    else:
        inside = some[shapes.are_there(other.inner[some])]
        found[inside] = ~meets_many(one, other.inner[inside], other.inner_radius[inside], surely=True)
    if wanted and isinstance(node, Contains) and isinstance(node.region, SectorAt):
        found &= _may_be_in_view(node.region, vector(node.point), vector, scalar)
    return found


def _may_meet(one: _Shapes, other: _Shapes, some: NDArray[np.intp]) -> _Mask:
    away = shapes.distances(one.middle[some], other.middle[some])
    return ~(away > one.off[some] + other.off[some] + SLACK)


def _must(node: RegionCondition, one: _Shapes, other: _Shapes, some: NDArray[np.intp]) -> _Mask:
    """Whether two random shapes meet anywhere in a case, or the one holds the other, which is a point."""
    inner = one.inner[some]
    if not isinstance(node, Contains):
        reach = one.inner_radius[some] + other.inner_radius[some]
        return shapes.distances(inner, other.inner[some]) <= reach
    near = shapes.distances(inner, other.middle[some]) + other.off[some] <= one.inner_radius[some]
    return near | (shapes.are_there(inner) & shapes.covers_many(inner, other.outer[some]))


def _may_enclose(outer: Region, box: _Shapes, some: NDArray[np.intp], *, wanted: bool) -> _Mask:
    if not wanted:
        return ~surely_covers_many(outer, box.outer[some])
    found = np.ones(len(some), dtype=bool)
    corners = shapes.coordinates_of_many(box.middle[some])
    for number in range(corners.shape[1]):
        # one reach for all is enough: cases that are narrowed together are alike
        found &= may_be_within(outer, corners[:, number], float(box.off[some].max(initial=0.0)) + SLACK)
    if isinstance(outer, PolygonSet):
        inner = np.flatnonzero(found & shapes.are_there(box.inner[some]))
        missed = missed_areas(outer, box.inner[some][inner])
        found[inner] = missed <= SLIVER * shapes.areas(box.outer[some][inner])
    return found


def _may_be_in_view(sector: SectorAt, place: domain.Enclosure, vector: Bounds, scalar: Bounds) -> _Mask:
    """Whether a point may lie in the direction of a sector."""
    bearing = domain.angle_of(domain.subtract(place, vector(sector.center)))
    off = domain.subtract(bearing, scalar(sector.heading))
    with np.errstate(invalid="ignore"):
        middle, half = normalize_array(off.mean(axis=0)), np.ptp(off, axis=0) / 2
        return ~(np.abs(middle) - half > scalar(sector.angle)[1] / 2 + SLACK)


def _side(region: Node, vector: Bounds, scalar: Bounds) -> Region | _Shapes | None:
    known = known_region(region)
    if known is not None:
        return known
    match region:
        case DiscAt() | SectorAt():
            points = _points(vector(region.center))
            low, high = scalar(region.radius)
            radius = low - points.off
            inner = shapes.no_shapes(len(radius))
            holds = (radius > 0) & isinstance(region, DiscAt)
            inner[holds] = points.middle[holds]
            off = points.off + np.maximum(high, 0.0)
            return _Shapes(points.middle, off, inner, np.maximum(radius, 0.0), points.outer)
        case RectangleAt():
            return _rectangles(region, vector, scalar)
        case _:
            return None


def _points(place: domain.Enclosure) -> _Shapes:
    middle, reach = middles(place)
    nothing = shapes.no_shapes(len(reach))
    safe = np.where(np.isfinite(place).all(axis=(0, 1)), place, 0.0)
    outer = shapes.boxes(np.concatenate([safe[:, 0], safe[:, 1]]).T)
    return _Shapes(shapes.points(middle.T), reach, nothing, np.zeros(len(reach)), outer)


def _rectangles(region: RectangleAt, vector: Bounds, scalar: Bounds) -> _Shapes:
    (x, y), off = middles(vector(region.center))
    numbers = np.stack([scalar(part) for part in (region.heading, region.width, region.length)])
    off = np.where(np.isfinite(numbers).all(axis=(0, 1)), off, np.inf)
    numbers = np.where(np.isfinite(numbers), numbers, 0.0)
    heading, width, length = numbers.mean(axis=1)
    turn, *more = np.ptp(numbers, axis=1) / 2
    radius = np.hypot(*np.abs(numbers[1:]).max(axis=1)) / 2
    # turned about its centre, a corner goes no farther than along the arc, and not beyond the far side
    off = off + np.minimum(turn, 2.0) * radius + np.hypot(*more) / 2 + SLACK

    def grown(by: _Numbers) -> NDArray[np.object_]:
        return box_polygons(x, y, heading, np.abs(width) + 2 * by, np.abs(length) + 2 * by)

    safe = np.where(np.isfinite(off), off, 0.0)
    inner = shapes.no_shapes(len(off))
    left = np.isfinite(off) & (np.minimum(np.abs(width), np.abs(length)) > 2 * safe)
    inner[left] = grown(-safe)[left]
    return _Shapes(grown(np.zeros(len(off))), off, inner, np.zeros(len(off)), grown(safe))
