"""Areas of regions: what the density of a uniform point is one over."""

from __future__ import annotations

import math
from functools import cache
from typing import assert_never

import shapely

from scenicq.geometry import shapes
from scenicq.geometry.angles import direction
from scenicq.geometry.boxes import box_polygon
from scenicq.geometry.membership import bounds
from scenicq.geometry.regions import (
    DifferenceOf,
    Disc,
    Everywhere,
    IntersectionOf,
    Nowhere,
    PointSet,
    PolygonSet,
    PolylineSet,
    Rectangle,
    Region,
    Sector,
    UnionOf,
)
from scenicq.geometry.shapes import Bounds, Shape

__all__ = ["area"]

_CORNERS = 256
"""Corners of the polygon that stands for a whole disc."""


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
    shape = _shape(region, (west, south, east, north))
    return None if shape is None else float(shape.area)


@cache
def _whole_area(region: PolygonSet) -> float:
    return float(shapes.union_all(region.polygons).area)


def _shape(region: Region, within: Bounds) -> Shape | None:
    """A polygon for a region, complete within bounds; None where it has no area of its own."""
    match region:
        case Everywhere():
            return shapely.box(*within)
        case Nowhere():
            return shapely.Polygon()
        case PolygonSet():
            return shapes.union_all(list(region.near(within)))
        case PolylineSet() | PointSet():
            return None
        case Disc():
            return _fan(Sector(region.center, region.radius, 0.0, math.tau))
        case Sector():
            return _fan(region)
        case Rectangle():
            return box_polygon(*region.center, region.heading, region.width, region.length)
        case UnionOf() | IntersectionOf():
            parts = [_shape(part, within) for part in region.parts]
            known = [part for part in parts if part is not None]
            if len(known) < len(parts):
                return None
            return shapes.union_all(known) if isinstance(region, UnionOf) else shapes.intersection_all(known)
        case DifferenceOf():
            base, removed = _shape(region.base, within), _shape(region.removed, within)
            return base if base is None or removed is None else shapes.difference(base, removed)
        case _:
            assert_never(region)


def _fan(sector: Sector) -> Shape:
    """A polygon with the corners of a sector on its arc, moved outward so that the area is the sector's own."""
    angle = min(max(sector.angle, 0.0), math.tau)
    steps = max(2, math.ceil(_CORNERS * angle / math.tau))
    half = angle / steps / 2
    out = sector.radius * math.sqrt(half / (math.sin(half) * math.cos(half))) if half > 0 else sector.radius
    x, y = sector.center
    start = sector.heading - angle / 2
    corners = [direction(start + angle * step / steps) for step in range(steps + 1)]
    points = [(x + out * dx, y + out * dy) for dx, dy in corners]
    return shapely.Polygon(points[:-1] if angle >= math.tau else [(x, y), *points])
