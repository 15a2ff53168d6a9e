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

from scenicq.errors import CannotEvaluate
from scenicq.forest.bounds import Box
from scenicq.forest.nodes import ArithmeticOp
from scenicq.geometry.boxes import corners as box_corners
from scenicq.geometry.cells import convex_cells
from scenicq.geometry.membership import bounds as region_bounds
from scenicq.geometry.regions import Disc, PointSet, PolygonSet, PolylineSet, Rectangle, Region, UnionOf
from scenicq.limits import LIMITS
from scenicq.smt.problem import Formula, Term
from scenicq.smt.region_membership import TermVector, convex_cell, disc
from scenicq.smt.terms import apply, compare, conjunction, disjunction, number

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
        c, s = apply(ArithmeticOp.COS, heading), apply(ArithmeticOp.SIN, heading)
        halves = (apply(ArithmeticOp.MUL, size, 0.5) for size in (width, length))
        return cls(center, (c, s), (apply(ArithmeticOp.NEG, s), c), *halves)

    def corners(self) -> list[TermVector]:
        """The four corners."""
        found: list[TermVector] = []
        for a, b in ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)):
            side, front = apply(ArithmeticOp.MUL, self.half_width, a), apply(ArithmeticOp.MUL, self.half_length, b)
            x, y = (
                apply(ArithmeticOp.ADD, middle, apply(ArithmeticOp.MUL, side, r), apply(ArithmeticOp.MUL, front, f))
                for middle, r, f in zip(self.center, self.right, self.ahead, strict=True)
            )
            found.append((x, y))
        return found

    def extent(self, axis: TermVector) -> Term:
        """Half of the box's extent along a unit vector."""
        return apply(
            ArithmeticOp.ADD,
            apply(ArithmeticOp.MUL, self.half_width, apply(ArithmeticOp.ABS, dot(self.right, axis))),
            apply(ArithmeticOp.MUL, self.half_length, apply(ArithmeticOp.ABS, dot(self.ahead, axis))),
        )


def dot(a: TermVector, b: TermVector) -> Term:
    """The scalar product."""
    return apply(ArithmeticOp.ADD, apply(ArithmeticOp.MUL, a[0], b[0]), apply(ArithmeticOp.MUL, a[1], b[1]))


def minus(a: TermVector, b: TermVector) -> TermVector:
    """The difference."""
    return apply(ArithmeticOp.SUB, a[0], b[0]), apply(ArithmeticOp.SUB, a[1], b[1])


def _square_length(a: TermVector) -> Term:
    return apply(ArithmeticOp.ADD, apply(ArithmeticOp.POW, a[0], 2.0), apply(ArithmeticOp.POW, a[1], 2.0))


def length(a: TermVector) -> Term:
    """The length of a vector."""
    return apply(ArithmeticOp.SQRT, _square_length(a))


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
            raise CannotEvaluate(f"the distance from a random point to a {type(region).__name__}")


def distance_term(region: Region, point: TermVector, around: Box) -> tuple[Term, list[tuple[Formula, Term]]]:
    """The distance from a point to a region: a term for points outside, and cases where it is something else.

    Args:
        region: The region.
        point: The point.
        around: Where the point can be; what is never nearest from there is left out.

    Raises:
        CannotEvaluate: The region has no segments, or too many of them.
    """
    if isinstance(region, Disc):
        away = length(minus(point, (number(region.center[0]), number(region.center[1]))))
        return apply(ArithmeticOp.MAX, apply(ArithmeticOp.SUB, away, region.radius), 0.0), []
    segments = _nearest_only(_points(region), around)
    if not len(segments) or len(segments) > LIMITS.distance_edges:
        raise CannotEvaluate("the distance from a random point to a region of so many edges")
    outside = apply(ArithmeticOp.MIN, *(_to_segment(point, segment) for segment in segments.tolist()))
    if not isinstance(region, PolygonSet | Rectangle):
        return outside, []
    (x0, x1), (y0, y1) = around
    west, south, east, north = region_bounds(region)
    cells = convex_cells(region, (max(x0, west), max(y0, south), min(x1, east), min(y1, north)))
    return outside, [(convex_cell(point, cell), number(0.0)) for cell in cells]


def _nearest_only(segments: np.ndarray, around: Box) -> np.ndarray:
    (x0, x1), (y0, y1) = around
    if not len(segments) or not all(map(math.isfinite, (x0, x1, y0, y1))):
        return segments
    lines = shapely.linestrings(segments.reshape(-1, 2, 2))
    middle = shapely.Point((x0 + x1) / 2, (y0 + y1) / 2)
    away = shapely.distance(lines, middle)
    return segments[away <= away.min() + math.hypot(x1 - x0, y1 - y0) + 1e-6]


def _to_segment(point: TermVector, segment: Sequence[float]) -> Term:
    return apply(ArithmeticOp.SQRT, squared_distance(point, segment))


def squared_distance(point: TermVector, segment: Sequence[float]) -> Term:
    """The square of the distance from a point to a segment x0, y0, x1, y1."""
    x0, y0, x1, y1 = segment
    dx, dy = x1 - x0, y1 - y0
    squared = dx * dx + dy * dy
    offset = minus(point, (number(x0), number(y0)))
    if squared > 0.0:
        share = apply(ArithmeticOp.DIV, dot(offset, (number(dx), number(dy))), squared)
        share = apply(ArithmeticOp.MIN, apply(ArithmeticOp.MAX, share, 0.0), 1.0)
        offset = minus(offset, (apply(ArithmeticOp.MUL, share, dx), apply(ArithmeticOp.MUL, share, dy)))
    return _square_length(offset)


def boxes_meet(one: BoxTerms, other: BoxTerms) -> Formula:
    """Whether two boxes have a point in common: none of their four axes separates them."""
    offset = minus(one.center, other.center)
    return conjunction(
        compare(
            "<=",
            apply(ArithmeticOp.ABS, dot(offset, axis)),
            apply(ArithmeticOp.ADD, one.extent(axis), other.extent(axis)),
        )
        for axis in (one.right, one.ahead, other.right, other.ahead)
    )


def disc_meets(box: BoxTerms, center: TermVector, radius: Term) -> Formula:
    """Whether a box and a disc have a point in common."""
    offset = minus(center, box.center)
    gaps = [
        apply(ArithmeticOp.MAX, apply(ArithmeticOp.SUB, apply(ArithmeticOp.ABS, dot(offset, axis)), half), 0.0)
        for axis, half in ((box.right, box.half_width), (box.ahead, box.half_length))
    ]
    return conjunction([compare(">=", radius, 0.0), disc(gaps[0], gaps[1], radius)])


def box_meets(box: BoxTerms, region: Region) -> Formula:
    """Whether a box and a known region have a point in common.

    Args:
        box: The box.
        region: Polygons, a rectangle, a disc, or a union of these.

    Raises:
        CannotEvaluate: The region is of another kind.
    """
    match region:
        case Rectangle():
            sizes = number(region.heading), number(region.width), number(region.length)
            return boxes_meet(box, BoxTerms.of((number(region.center[0]), number(region.center[1])), *sizes))
        case Disc():
            return disc_meets(box, (number(region.center[0]), number(region.center[1])), number(region.radius))
        case PolygonSet():
            cells = convex_cells(region, region_bounds(region))
            if len(cells) > LIMITS.distance_edges:
                raise CannotEvaluate("whether a random box meets a region of so many pieces")
            return disjunction(_box_meets_cell(box, cell) for cell in cells)
        case UnionOf():
            return disjunction(box_meets(box, part) for part in region.parts)
        case _:
            raise CannotEvaluate(f"whether a random box meets a {type(region).__name__}")


def _box_meets_cell(box: BoxTerms, cell: np.ndarray) -> Formula:
    parts: list[Formula] = []
    for (ax, ay), (bx, by) in zip(cell.tolist(), np.roll(cell, -1, axis=0).tolist(), strict=True):
        size = math.hypot(bx - ax, by - ay)
        if size > 0:
            outward = (number((by - ay) / size), number((ax - bx) / size))
            nearest = apply(ArithmeticOp.SUB, dot(box.center, outward), box.extent(outward))
            parts.append(compare("<=", nearest, outward[0].value * ax + outward[1].value * ay))
    for axis, half in ((box.right, box.half_width), (box.ahead, box.half_length)):
        places = [dot((number(x), number(y)), axis) for x, y in cell.tolist()]
        middle = dot(box.center, axis)
        parts.append(compare("<=", apply(ArithmeticOp.MIN, *places), apply(ArithmeticOp.ADD, middle, half)))
        parts.append(compare("<=", apply(ArithmeticOp.SUB, middle, half), apply(ArithmeticOp.MAX, *places)))
    return conjunction(parts)
