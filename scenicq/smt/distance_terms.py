"""Distances to regions, and boxes that meet regions, as terms and formulas.

A point is at the distance of its nearest segment; two convex shapes meet unless a line separates them, and the line can
be taken along an edge of one of them.
"""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from scenicq.forest.bounds import Box
from scenicq.geometry.boxes import corners as box_corners
from scenicq.geometry.cells import convex_cells
from scenicq.geometry.membership import bounds as region_bounds
from scenicq.geometry.regions import Disc, PointSet, PolygonSet, PolylineSet, Rectangle, Region, UnionOf
from scenicq.limits import LIMITS
from scenicq.smt.formula import Formula, Num, Operator, Term, apply, compare, conjunction, disjunction
from scenicq.smt.region_membership import TermVector, UnsupportedError, convex_cell, disc

__all__ = [
    "BoxTerms",
    "box_meets",
    "boxes_meet",
    "disc_meets",
    "distance_term",
    "dot",
    "length",
    "minus",
    "squared_distance",
]


@dataclass(frozen=True, slots=True)
class BoxTerms:
    """A box as terms: centre, unit vectors to the right and ahead, half width and half length."""

    center: TermVector
    right: TermVector
    ahead: TermVector
    half_width: Term
    half_length: Term

    @classmethod
    def of(cls, center: TermVector, heading: Term, width: Term, length: Term) -> BoxTerms:
        """The frame of a box."""
        c, s = apply(Operator.COS, heading), apply(Operator.SIN, heading)
        halves = (apply(Operator.MUL, size, 0.5) for size in (width, length))
        return cls(center, (c, s), (apply(Operator.NEG, s), c), *halves)

    def corners(self) -> list[TermVector]:
        """The four corners."""
        found: list[TermVector] = []
        for a, b in ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)):
            side, front = apply(Operator.MUL, self.half_width, a), apply(Operator.MUL, self.half_length, b)
            x, y = (
                apply(Operator.ADD, middle, apply(Operator.MUL, side, r), apply(Operator.MUL, front, f))
                for middle, r, f in zip(self.center, self.right, self.ahead, strict=True)
            )
            found.append((x, y))
        return found

    def extent(self, axis: TermVector) -> Term:
        """Half of the box's extent along a unit vector."""
        return apply(
            Operator.ADD,
            apply(Operator.MUL, self.half_width, apply(Operator.ABS, dot(self.right, axis))),
            apply(Operator.MUL, self.half_length, apply(Operator.ABS, dot(self.ahead, axis))),
        )


def dot(a: TermVector, b: TermVector) -> Term:
    """The scalar product."""
    return apply(Operator.ADD, apply(Operator.MUL, a[0], b[0]), apply(Operator.MUL, a[1], b[1]))


def minus(a: TermVector, b: TermVector) -> TermVector:
    """The difference."""
    return apply(Operator.SUB, a[0], b[0]), apply(Operator.SUB, a[1], b[1])


def _square_length(a: TermVector) -> Term:
    return apply(Operator.ADD, apply(Operator.POW, a[0], 2.0), apply(Operator.POW, a[1], 2.0))


def length(a: TermVector) -> Term:
    """The length of a vector."""
    return apply(Operator.SQRT, _square_length(a))


def _points(region: Region) -> np.ndarray:
    """Segments (n, 4) whose nearest one gives the distance from outside of a region."""
    match region:
        case PolygonSet() | PolylineSet():
            rows = [np.empty((0, 4))]
            for piece in region.pieces:
                lines = [piece.exterior, *piece.interiors] if isinstance(piece, shapely.Polygon) else [piece]
                for line in lines:
                    corners = shapely.get_coordinates(line)
                    rows.append(np.concatenate([corners[:-1], corners[1:]], axis=1))
            return np.concatenate(rows)
        case Rectangle():
            outline = box_corners(*region.center, region.heading, region.width, region.length)
            return np.concatenate([outline, np.roll(outline, -1, axis=0)], axis=1)
        case PointSet():
            points = np.array(region.points, dtype=float).reshape(-1, 2)
            return np.concatenate([points, points], axis=1)
        case _:
            raise UnsupportedError(f"the distance from a random point to a {type(region).__name__}")


def distance_term(region: Region, point: TermVector, around: Box) -> tuple[Term, list[tuple[Formula, Term]]]:
    """The distance from a point to a region: a term for points outside, and cases where it is something else.

    Args:
        region: The region.
        point: The point.
        around: Where the point can be; what is never nearest from there is left out.

    Raises:
        UnsupportedError: The region has no segments, or too many of them.
    """
    if isinstance(region, Disc):
        away = length(minus(point, (Num(region.center[0]), Num(region.center[1]))))
        return apply(Operator.MAX, apply(Operator.SUB, away, region.radius), 0.0), []
    segments = _nearest_only(_points(region), around)
    if not len(segments) or len(segments) > LIMITS.distance_edges:
        raise UnsupportedError("the distance from a random point to a region of so many edges")
    outside = apply(Operator.MIN, *(_to_segment(point, segment) for segment in segments.tolist()))
    if not isinstance(region, PolygonSet | Rectangle):
        return outside, []
    (x0, x1), (y0, y1) = around
    west, south, east, north = region_bounds(region)
    cells = convex_cells(region, (max(x0, west), max(y0, south), min(x1, east), min(y1, north)))
    return outside, [(convex_cell(point, cell), Num(0.0)) for cell in cells]


def _nearest_only(segments: np.ndarray, around: Box) -> np.ndarray:
    (x0, x1), (y0, y1) = around
    if not len(segments) or not all(map(math.isfinite, (x0, x1, y0, y1))):
        return segments
    lines = shapely.linestrings(segments.reshape(-1, 2, 2))
    middle = shapely.Point((x0 + x1) / 2, (y0 + y1) / 2)
    away = shapely.distance(lines, middle)
    return segments[away <= away.min() + math.hypot(x1 - x0, y1 - y0) + 1e-6]


def _to_segment(point: TermVector, segment: Sequence[float]) -> Term:
    return apply(Operator.SQRT, squared_distance(point, segment))


def squared_distance(point: TermVector, segment: Sequence[float]) -> Term:
    """The square of the distance from a point to a segment x0, y0, x1, y1."""
    x0, y0, x1, y1 = segment
    dx, dy = x1 - x0, y1 - y0
    squared = dx * dx + dy * dy
    offset = minus(point, (Num(x0), Num(y0)))
    if squared > 0.0:
        share = apply(Operator.DIV, dot(offset, (Num(dx), Num(dy))), squared)
        share = apply(Operator.MIN, apply(Operator.MAX, share, 0.0), 1.0)
        offset = minus(offset, (apply(Operator.MUL, share, dx), apply(Operator.MUL, share, dy)))
    return _square_length(offset)


def boxes_meet(one: BoxTerms, other: BoxTerms) -> Formula:
    """Whether two boxes have a point in common: none of their four axes separates them."""
    offset = minus(one.center, other.center)
    return conjunction(
        compare("<=", apply(Operator.ABS, dot(offset, axis)), apply(Operator.ADD, one.extent(axis), other.extent(axis)))
        for axis in (one.right, one.ahead, other.right, other.ahead)
    )


def disc_meets(box: BoxTerms, center: TermVector, radius: Term) -> Formula:
    """Whether a box and a disc have a point in common."""
    offset = minus(center, box.center)
    gaps = [
        apply(Operator.MAX, apply(Operator.SUB, apply(Operator.ABS, dot(offset, axis)), half), 0.0)
        for axis, half in ((box.right, box.half_width), (box.ahead, box.half_length))
    ]
    return conjunction([compare(">=", radius, 0.0), disc(gaps[0], gaps[1], radius)])


def box_meets(box: BoxTerms, region: Region) -> Formula:
    """Whether a box and a known region have a point in common.

    Args:
        box: The box.
        region: Polygons, a rectangle, a disc, or a union of these.

    Raises:
        UnsupportedError: The region is of another kind.
    """
    match region:
        case Rectangle():
            sizes = Num(region.heading), Num(region.width), Num(region.length)
            return boxes_meet(box, BoxTerms.of((Num(region.center[0]), Num(region.center[1])), *sizes))
        case Disc():
            return disc_meets(box, (Num(region.center[0]), Num(region.center[1])), Num(region.radius))
        case PolygonSet():
            cells = convex_cells(region, region_bounds(region))
            if len(cells) > LIMITS.distance_edges:
                raise UnsupportedError("whether a random box meets a region of so many pieces")
            return disjunction(_box_meets_cell(box, cell) for cell in cells)
        case UnionOf():
            return disjunction(box_meets(box, part) for part in region.parts)
        case _:
            raise UnsupportedError(f"whether a random box meets a {type(region).__name__}")


def _box_meets_cell(box: BoxTerms, cell: np.ndarray) -> Formula:
    parts: list[Formula] = []
    for (ax, ay), (bx, by) in zip(cell.tolist(), np.roll(cell, -1, axis=0).tolist(), strict=True):
        size = math.hypot(bx - ax, by - ay)
        if size > 0:
            outward = (Num((by - ay) / size), Num((ax - bx) / size))
            nearest = apply(Operator.SUB, dot(box.center, outward), box.extent(outward))
            parts.append(compare("<=", nearest, outward[0].value * ax + outward[1].value * ay))
    for axis, half in ((box.right, box.half_width), (box.ahead, box.half_length)):
        places = [dot((Num(x), Num(y)), axis) for x, y in cell.tolist()]
        middle = dot(box.center, axis)
        parts.append(compare("<=", apply(Operator.MIN, *places), apply(Operator.ADD, middle, half)))
        parts.append(compare("<=", apply(Operator.SUB, middle, half), apply(Operator.MAX, *places)))
    return conjunction(parts)
