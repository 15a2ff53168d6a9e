"""Points in regions as formulas (query paper, appendix A.2, figure 19: On, Disc, Sector, tri)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeAlias, cast

import numpy as np

from scenicq.errors import CannotEvaluate
from scenicq.forest.bounds import Box
from scenicq.forest.nodes import (
    ArithmeticOp,
    Constant,
    DiscAt,
    Node,
    RectangleAt,
    RegionDifference,
    RegionIntersection,
    RegionUnion,
    SectorAt,
    Select,
    Undefined,
)
from scenicq.geometry import shapes
from scenicq.geometry.cells import convex_cells
from scenicq.geometry.membership import bounds as region_bounds
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
from scenicq.geometry.shapes import Bounds
from scenicq.smt.problem import Formula, Term, is_formula
from scenicq.smt.terms import FALSE, TRUE, apply, compare, conjunction, disjunction, negation

__all__ = ["TermVector", "convex_cell", "disc", "index_equals", "inside_region"]

TermVector: TypeAlias = tuple[Term, Term]


def index_equals(index: Term | Formula, number: int) -> Formula:
    """That an index, known to be a whole number, is this one; wide of it, so that the opposite is robust, too.

    The index may also be a truth value: 0 is false and 1 is true.
    """
    if is_formula(index):
        return index if number else negation(index)
    term = cast(Term, index)
    return conjunction([compare("<=", number - 0.25, term), compare("<=", term, number + 0.25)])


def disc(dx: Term, dy: Term, radius: Term | float) -> Formula:
    """An offset of at most a radius (figure 19: Disc)."""
    squares = apply(ArithmeticOp.ADD, apply(ArithmeticOp.POW, dx, 2.0), apply(ArithmeticOp.POW, dy, 2.0))
    return compare("<=", squares, apply(ArithmeticOp.POW, radius, 2.0))


def convex_cell(point: TermVector, polygon: np.ndarray) -> Formula:
    """A point in a convex polygon (k, 2) whose corners run counter-clockwise: left of every edge."""
    x, y = point
    sides: list[Formula] = []
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        length = math.hypot(bx - ax, by - ay)
        if length > 0:
            nx, ny = float(by - ay) / length, float(ax - bx) / length
            across = apply(ArithmeticOp.ADD, apply(ArithmeticOp.MUL, x, nx), apply(ArithmeticOp.MUL, y, ny))
            sides.append(compare("<=", across, nx * float(ax) + ny * float(ay)))
    return conjunction(sides)


def _local(dx: Term, dy: Term, heading: Term | float) -> TermVector:
    """An offset in the frame of a heading: right and ahead."""
    c, s = apply(ArithmeticOp.COS, heading), apply(ArithmeticOp.SIN, heading)
    right = apply(ArithmeticOp.ADD, apply(ArithmeticOp.MUL, dx, c), apply(ArithmeticOp.MUL, dy, s))
    ahead = apply(ArithmeticOp.SUB, apply(ArithmeticOp.MUL, dy, c), apply(ArithmeticOp.MUL, dx, s))
    return right, ahead


def _wedge(right: Term, ahead: Term, half: float) -> Formula:
    """An offset within an angle of straight ahead; any half angle from 0 to pi (figure 19's is for less than pi/2)."""
    if half >= math.pi:
        return TRUE
    c, s = math.cos(half), math.sin(half)
    reach = apply(ArithmeticOp.MUL, ahead, s)
    side = apply(ArithmeticOp.MUL, right, c)
    left_of = compare("<=", side, reach)
    right_of = compare("<=", apply(ArithmeticOp.NEG, side), reach)
    return conjunction([left_of, right_of]) if half <= math.pi / 2 else disjunction([left_of, right_of])


def _sector(dx: Term, dy: Term, radius: Term | float, heading: Term | float, angle: float) -> Formula:
    right, ahead = _local(dx, dy, heading)
    return conjunction([disc(dx, dy, radius), _wedge(right, ahead, angle / 2)])


def _rectangle(dx: Term, dy: Term, heading: Term | float, width: Term | float, length: Term | float) -> Formula:
    right, ahead = _local(dx, dy, heading)
    return conjunction(
        compare("<=", apply(ArithmeticOp.ABS, offset), apply(ArithmeticOp.MUL, size, 0.5))
        for offset, size in ((right, width), (ahead, length))
    )


def _offset(point: TermVector, center: tuple[Term | float, Term | float]) -> TermVector:
    return apply(ArithmeticOp.SUB, point[0], center[0]), apply(ArithmeticOp.SUB, point[1], center[1])


def _near(edge: np.ndarray, limits: Bounds) -> bool:
    """Whether the box around an edge (x0, y0, x1, y1) meets the limits."""
    x0, y0, x1, y1 = edge
    west, south, east, north = limits
    return min(x0, x1) <= east and max(x0, x1) >= west and min(y0, y1) <= north and max(y0, y1) >= south


def _segment(point: TermVector, edge: np.ndarray) -> Formula:
    """A point on an edge (x0, y0, x1, y1)."""
    x0, y0, x1, y1 = map(float, edge)
    length = math.hypot(x1 - x0, y1 - y0)
    if length == 0:
        return conjunction([compare("==", point[0], x0), compare("==", point[1], y0)])
    ux, uy = (x1 - x0) / length, (y1 - y0) / length
    along = apply(ArithmeticOp.ADD, apply(ArithmeticOp.MUL, point[0], ux), apply(ArithmeticOp.MUL, point[1], uy))
    across = apply(ArithmeticOp.SUB, apply(ArithmeticOp.MUL, point[0], uy), apply(ArithmeticOp.MUL, point[1], ux))
    start = ux * x0 + uy * y0
    return conjunction(
        [
            compare("==", across, uy * x0 - ux * y0),
            compare(">=", along, start),
            compare("<=", along, start + length),
        ]
    )


def _known_region(region: Region, point: TermVector, around: Box) -> Formula:
    match region:
        case Everywhere():
            return TRUE
        case Nowhere():
            return FALSE
        case Disc():
            return disc(*_offset(point, region.center), region.radius)
        case Sector():
            return _sector(*_offset(point, region.center), region.radius, region.heading, region.angle)
        case Rectangle():
            return _rectangle(*_offset(point, region.center), region.heading, region.width, region.length)
        case PolygonSet():
            west, south, east, north = region_bounds(region)
            (x0, x1), (y0, y1) = around
            limits = (max(x0, west), max(y0, south), min(x1, east), min(y1, north))
            if limits[0] > limits[2] or limits[1] > limits[3]:
                return FALSE
            return disjunction(convex_cell(point, cell) for cell in convex_cells(region, limits))
        case PolylineSet():
            (x0, x1), (y0, y1) = around
            west, south, east, north = region_bounds(region)
            limits = (max(x0, west), max(y0, south), min(x1, east), min(y1, north))
            if limits[0] > limits[2] or limits[1] > limits[3]:
                return FALSE
            edges = (edge for line in region.near(limits) for edge in shapes.edges(line))
            return disjunction(_segment(point, edge) for edge in edges if _near(edge, limits))
        case PointSet():
            return disjunction(
                conjunction([compare("==", point[0], x), compare("==", point[1], y)]) for x, y in region.points
            )
        case UnionOf():
            return disjunction(_known_region(part, point, around) for part in region.parts)
        case IntersectionOf():
            return conjunction(_known_region(part, point, around) for part in region.parts)
        case DifferenceOf():
            removed = _known_region(region.removed, point, around)
            return conjunction([_known_region(region.base, point, around), negation(removed)])


def inside_region(region: Node, point: TermVector, around: Box, code: Callable[[Node], object]) -> Formula:
    """A point in a region whose shape may depend on random variables.

    Args:
        region: The region's expression.
        point: The point's coordinates as terms.
        around: Where the point can be; map cells elsewhere are left out.
        code: Gives the term of a subexpression.

    Raises:
        CannotEvaluate: The region is a sector of random angle.
    """
    known: dict[int, Formula] = {}
    todo = [region]
    while todo:
        node = todo[-1]
        parts = _parts(node)
        missing = [part for part in parts if id(part) not in known]
        if missing:
            todo += reversed(missing)
            continue
        todo.pop()
        known[id(node)] = _inside(node, [known[id(part)] for part in parts], point, around, code)
    return known[id(region)]


def _parts(region: Node) -> tuple[Node, ...]:
    """The regions that a region is made of."""
    match region:
        case RegionUnion() | RegionIntersection():
            return region.parts
        case RegionDifference():
            return region.removed, region.base
        case Select():
            return region.options
        case _:
            return ()


def _inside(
    region: Node, parts: Sequence[Formula], point: TermVector, around: Box, code: Callable[[Node], object]
) -> Formula:
    """A point in a region, given whether it is in the regions that this one is made of."""
    match region:
        case Constant(value=Undefined()):
            return FALSE
        case Constant():
            return _known_region(cast(Region, region.value), point, around)
        case DiscAt():
            return disc(*_offset(point, cast(TermVector, code(region.center))), cast(Term, code(region.radius)))
        case SectorAt():
            if not isinstance(region.angle, Constant):
                raise CannotEvaluate("a view of random angle")
            offset = _offset(point, cast(TermVector, code(region.center)))
            radius, heading = cast(Term, code(region.radius)), cast(Term, code(region.heading))
            return _sector(*offset, radius, heading, cast(float, region.angle.value))
        case RectangleAt():
            offset = _offset(point, cast(TermVector, code(region.center)))
            sizes = [cast(Term, code(part)) for part in (region.heading, region.width, region.length)]
            return _rectangle(*offset, *sizes)
        case RegionUnion():
            return disjunction(parts)
        case RegionIntersection():
            return conjunction(parts)
        case RegionDifference():
            removed, base = parts
            return conjunction([base, negation(removed)])
        case Select():
            index = cast("Term | Formula", code(region.index))
            return disjunction(conjunction([index_equals(index, number), part]) for number, part in enumerate(parts))
        case _:
            raise CannotEvaluate(f"a region given as {type(region).__name__}")
