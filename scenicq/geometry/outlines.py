"""Polygons for regions: arcs become corners that lie inside of them, outside, or so that the area is the same."""

from __future__ import annotations

import math
from typing import Literal, assert_never

from scenicq.geometry import shapes
from scenicq.geometry.angles import direction
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
from scenicq.geometry.shapes import XY, Bounds, Shape
from scenicq.geometry.terms import rectangle_shape

__all__ = ["Side", "clip", "disc_outline", "outline", "sector_outline"]

Side = Literal["inner", "outer", "same area"]
"""Whether a polygon lies within what it stands for, holds it, or is as large."""

_CORNERS = 128
"""Corners of the polygon that stands for a whole disc."""
_ROUNDING = 1e-9
"""What sines are off by, relative to the radius."""
_OPPOSITE: dict[Side, Side] = {"inner": "outer", "outer": "inner", "same area": "same area"}


def disc_outline(x: float, y: float, radius: float, side: Side) -> Shape:
    """The polygon for a disc."""
    return sector_outline(Sector((x, y), radius, 0.0, math.tau), side)


def sector_outline(sector: Sector, side: Side) -> Shape:
    """The polygon for a sector; from a full turn on, for the disc."""
    angle = min(max(sector.angle, 0.0), math.tau)
    steps = max(2, math.ceil(_CORNERS * angle / math.tau))
    half = angle / steps / 2
    reach = sector.radius
    if side == "outer":
        reach *= (1 + _ROUNDING) / math.cos(half)
    elif side == "inner":
        reach *= 1 - _ROUNDING
    elif half > 0:
        reach *= math.sqrt(half / (math.sin(half) * math.cos(half)))
    x, y = sector.center
    first = sector.heading - angle / 2
    turns = [direction(first + angle * step / steps) for step in range(steps + 1)]
    rim: list[XY] = [(x + reach * dx, y + reach * dy) for dx, dy in turns]
    return shapes.polygon(rim[:-1] if angle >= math.tau else [(x, y), *rim])


def outline(region: Region, within: Bounds, side: Side = "outer") -> list[Shape]:
    """Shapes whose union stands for a region within bounds (metres): polygons, lines and points."""
    match region:
        case Everywhere():
            return [shapes.box(*within)]
        case Nowhere():
            return []
        case (Disc() | Sector()) as empty if empty.radius < 0:
            return []
        case Disc():
            return clip([disc_outline(*region.center, region.radius, side)], within)
        case Sector():
            return clip([sector_outline(region, side)], within)
        case Rectangle():
            return clip([rectangle_shape(region)], within)
        case PolygonSet() | PolylineSet() | PointSet():
            return clip(region.near(within), within)
        case UnionOf():
            return [piece for part in region.parts for piece in outline(part, within, side)]
        case IntersectionOf():
            found = [shapes.box(*within)]
            for part in region.parts:
                inside = outline(part, within, side)
                whole = inside[0] if len(inside) == 1 else shapes.union_all(inside)
                found = [cut for piece in found if not (cut := shapes.intersection(piece, whole)).is_empty]
            return found
        case DifferenceOf():
            removed = shapes.union_all(outline(region.removed, within, _OPPOSITE[side]))
            base = outline(region.base, within, side)
            return [cut for piece in base if not (cut := shapes.difference(piece, removed)).is_empty]
        case _:
            assert_never(region)


def clip(pieces: list[Shape], bounds: Bounds) -> list[Shape]:
    """The parts of shapes within bounds."""
    cut: list[Shape] = shapes.intersections(pieces, shapes.box(*bounds))
    return [piece for piece in cut if not piece.is_empty]
