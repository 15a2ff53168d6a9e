"""Whether a box whose place is random lies in a known region (`regionContainedIn`, the workspace).

A convex region holds a box if it holds its corners. Another one does if it holds the box's centre and no part of its
border runs through the box: a segment and a box miss each other if a line along one of them separates them.
"""

from __future__ import annotations

import math

from scenicq.errors import CannotEvaluate
from scenicq.forest.bounds import Box
from scenicq.forest.nodes import ArithmeticOp
from scenicq.geometry import shapes
from scenicq.geometry.cells import convex_parts
from scenicq.geometry.membership import bounds as region_bounds
from scenicq.geometry.regions import Disc, Everywhere, IntersectionOf, Nowhere, PolygonSet, Rectangle, Region, UnionOf
from scenicq.geometry.shapes import Shape
from scenicq.geometry.terms import overlap, rectangle_shape
from scenicq.limits import LIMITS
from scenicq.smt.distance_terms import BoxTerms, dot, minus
from scenicq.smt.problem import Formula
from scenicq.smt.region_membership import convex_cell, disc
from scenicq.smt.terms import FALSE, TRUE, apply, compare, conjunction, disjunction, number

__all__ = ["box_holds"]


def box_holds(box: BoxTerms, region: Region, around: Box) -> Formula:
    """Whether a known region holds all of a box.

    Args:
        box: The box.
        region: Polygons, a rectangle, a disc, or unions of polygons and intersections of these.
        around: Where the box's corners can be; the region's border elsewhere is left out.

    Raises:
        CannotEvaluate: The region is of another kind, or its border has too many edges there.
    """
    match region:
        case Everywhere():
            return TRUE
        case Nowhere():
            return FALSE
        case Disc():
            center = (number(region.center[0]), number(region.center[1]))
            return conjunction(disc(*minus(corner, center), region.radius) for corner in box.corners())
        case Rectangle():
            return _area_holds(box, rectangle_shape(region), around)
        case PolygonSet():
            return _area_holds(box, _near([region], around), around)
        case UnionOf() if all(isinstance(part, PolygonSet) for part in region.parts):
            return _area_holds(
                box, _near([part for part in region.parts if isinstance(part, PolygonSet)], around), around
            )
        case IntersectionOf():
            return conjunction(box_holds(box, part, around) for part in region.parts)
        case _:
            raise CannotEvaluate(f"whether a random box lies in a {type(region).__name__}")


def _near(regions: list[PolygonSet], around: Box) -> Shape:
    """The polygons that a box can touch, as one shape: where they meet, there is no border."""
    found: list[Shape] = []
    (x0, x1), (y0, y1) = around
    for region in regions:
        limits = overlap((x0, y0, x1, y1), region_bounds(region))
        if limits[0] <= limits[2] and limits[1] <= limits[3]:
            found += region.near(limits)
    return shapes.union_all(found)


def _area_holds(box: BoxTerms, area: Shape, around: Box) -> Formula:
    cells = [cell for piece in shapes.polygonal_part(area) for cell in convex_parts(piece)]
    if len(cells) == 1:
        return conjunction(convex_cell(corner, cells[0]) for corner in box.corners())
    (x0, x1), (y0, y1) = around
    border = [edge for piece in shapes.polygonal_part(area) for edge in shapes.edges(piece).tolist()]
    close = [
        (ax, ay, bx, by)
        for ax, ay, bx, by in border
        if min(ax, bx) <= x1 and max(ax, bx) >= x0 and min(ay, by) <= y1 and max(ay, by) >= y0
    ]
    if len(close) > LIMITS.enclosing_edges:
        raise CannotEvaluate("whether a random box lies in a region of so many edges")
    inside = disjunction(convex_cell(box.center, cell) for cell in cells)
    return conjunction([inside, *(_missed(box, *edge) for edge in close)])


def _missed(box: BoxTerms, ax: float, ay: float, bx: float, by: float) -> Formula:
    """That a segment has no point inside a box."""
    length = math.hypot(bx - ax, by - ay)
    if length == 0.0:
        return TRUE
    ends = [minus((number(x), number(y)), box.center) for x, y in ((ax, ay), (bx, by))]
    sides: list[Formula] = []
    for axis, half in ((box.right, box.half_width), (box.ahead, box.half_length)):
        places = [dot(end, axis) for end in ends]
        sides.append(compare(">=", apply(ArithmeticOp.MIN, *places), half))
        sides.append(compare("<=", apply(ArithmeticOp.MAX, *places), apply(ArithmeticOp.NEG, half)))
    across = (number((by - ay) / length), number((ax - bx) / length))
    sides.append(compare(">=", apply(ArithmeticOp.ABS, dot(ends[0], across)), box.extent(across)))
    return disjunction(sides)
