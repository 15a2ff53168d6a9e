"""Areas of regions: what the density of a uniform point is one over."""

from __future__ import annotations

import math
from functools import cache

from scenicq.geometry import shapes
from scenicq.geometry.membership import bounds
from scenicq.geometry.outlines import outline
from scenicq.geometry.regions import (
    DifferenceOf,
    Disc,
    IntersectionOf,
    PointSet,
    PolygonSet,
    PolylineSet,
    Rectangle,
    Region,
    Sector,
    UnionOf,
)

__all__ = ["area"]


def area(region: Region) -> float | None:
    """The area of a region in square metres, to about a thousandth where it has arcs; None if it has none of its own.

    Lines and points have none, and neither has what is unbounded.
    """
    if isinstance(region, PolygonSet):
        return _whole_area(region)
    if isinstance(region, Disc):
        return math.pi * region.radius * region.radius
    if isinstance(region, Sector):
        return min(max(region.angle, 0.0), math.tau) * region.radius * region.radius / 2
    if isinstance(region, Rectangle):
        return region.width * region.length
    west, south, east, north = bounds(region)
    if not (math.isfinite(east - west) and math.isfinite(north - south)):
        return 0.0 if west > east else None
    if _is_flat(region):
        return None
    return float(shapes.union_all(outline(region, (west, south, east, north), "same area")).area)


@cache
def _whole_area(region: PolygonSet) -> float:
    return float(shapes.union_all(region.polygons).area)


def _is_flat(region: Region) -> bool:
    """Whether lines or points are part of a region, so that a point of it has no density over an area."""
    match region:
        case UnionOf() | IntersectionOf():
            return any(map(_is_flat, region.parts))
        case DifferenceOf():
            return _is_flat(region.base)
        case _:
            return isinstance(region, PolylineSet | PointSet)
