"""Distances of hidden points from map elements, as areas in which the points lie.

What a label shows leaves a hidden point a small box. Over that box a distance from something of the map has bounds,
which often decide a comparison; else the points that satisfy it are an area, outlined by polygons that leave none out.
With areas in place of distances, constraints are linear.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from shapely.geometry import Polygon

from scenicq.forest.bounds import Box, vector_bounds
from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import MIRRORED, Compare, CompareOp, Constant, Contains, Distance, Node
from scenicq.geometry import shapes
from scenicq.geometry.membership import distance
from scenicq.geometry.regions import Nowhere, PolygonSet, PolylineSet, Region, UnionOf
from scenicq.geometry.shapes import Bounds, Shape
from scenicq.limits import LIMITS
from scenicq.match.linear.linear_relaxation import position_boxes
from scenicq.match.problem.conditioned import Item
from scenicq.match.tolerance import SLACK, Tolerance

__all__ = ["with_areas"]

_AROUND = 1 / math.cos(math.pi / (4 * shapes.QUARTER_SEGMENTS))
"""A polygon around a circle is that much larger than the one inside of it with as many corners."""


def with_areas(items: Sequence[Item], tolerance: Tolerance, *, outer: bool = True) -> list[Item] | None:
    """Constraints with areas in place of distances of hidden points; None if there are no such distances.

    Args:
        items: The constraints, conditioned, in conjuncts.
        tolerance: Per feature.
        outer: Whether areas leave out no point that satisfies the constraints; else they have no other points.
    """
    compared = [_distance_of(node) for constraint, node, _ in items if not isinstance(constraint, Comparison)]
    if not any(compared):
        return None
    boxes = position_boxes(items, tolerance)
    found: list[Item] = []
    changed = False
    for constraint, node, seen in items:
        asked = None if isinstance(constraint, Comparison) else _distance_of(node)
        area = None if asked is None else _area_of(asked, vector_bounds(asked.point, boxes), outer=outer)
        if asked is None or area is None:
            found.append((constraint, node, seen))
            continue
        changed = True
        within = (
            Constant(False, span=node.span)
            if isinstance(area, Nowhere)
            else Contains(Constant(area, span=node.span), asked.point, span=node.span)
        )
        found.append((constraint, within, seen))
    return found if changed else None


@dataclass(frozen=True, slots=True)
class _Asked:
    """A distance of a point from a region that is at most (else at least) a limit in metres."""

    region: Region
    point: Node
    most: bool
    limit: float


def _distance_of(node: Node) -> _Asked | None:
    """The comparison of a distance with a number that a condition is, if it is one."""
    match node:
        case Compare(op, Distance(Constant(value=value), point), Constant(value=float() as limit)):
            pass
        case Compare(op, Constant(value=float() as limit), Distance(Constant(value=value), point)) if op in MIRRORED:
            op = MIRRORED[op]
        case _:
            return None
    if op not in MIRRORED or isinstance(point, Constant) or not isinstance(value, Region):
        return None
    return _Asked(value, point, op in (CompareOp.LT, CompareOp.LE), limit)


def _area_of(asked: _Asked, box: Box, *, outer: bool) -> Region | None:
    """Where in a box a distance is at most, or at least, a limit; None if that is not known."""
    region, most, limit = asked.region, asked.most, asked.limit
    (x0, x1), (y0, y1) = box
    if not all(map(math.isfinite, (x0, x1, y0, y1))):
        return None
    if x0 > x1 or y0 > y1:
        return Nowhere()
    away, half = distance(region, (x0 + x1) / 2, (y0 + y1) / 2), math.hypot(x1 - x0, y1 - y0) / 2 + SLACK
    window = shapes.box(x0 - SLACK, y0 - SLACK, x1 + SLACK, y1 + SLACK)
    if away + half < limit or away - half > limit:
        # the point may occur nowhere else, and still needs a value
        return _set((window,)) if (away < limit) is most else Nowhere()
    if limit < 0 or max(x1 - x0, y1 - y0) > LIMITS.outlined_box_m:
        return None
    # polygons around circles for the largest area within a distance, and for the smallest beyond it
    reach = limit * _AROUND + SLACK if most is outer else max(0.0, limit - SLACK)
    near = _pieces(region, (x0 - reach, y0 - reach, x1 + reach, y1 + reach))
    if near is None:
        return None
    grown = shapes.union_all([shapes.grown(piece, reach) for piece in near])
    left = shapes.intersection(window, grown) if most else shapes.difference(window, grown)
    polygons = shapes.polygonal_part(left)
    return _set(polygons) if polygons else Nowhere()


def _set(polygons: tuple[Shape, ...]) -> PolygonSet:
    return PolygonSet(cast("tuple[Polygon, ...]", polygons), "within a distance")


def _pieces(region: Region, bounds: Bounds) -> list[Shape] | None:
    """The shapes of a region near a box, None of one that is not made of shapes."""
    found: list[Shape] = []
    for part in region.parts if isinstance(region, UnionOf) else (region,):
        if not isinstance(part, PolygonSet | PolylineSet):
            return None
        found += part.near(bounds)
    return found
