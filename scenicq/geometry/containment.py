"""Whether a region holds all of a box, and whether two regions share a point."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Polygon

from scenicq.geometry import shapes
from scenicq.geometry.membership import bounds, may_be_within
from scenicq.geometry.proximity import meets, meets_many
from scenicq.geometry.regions import (
    SLACK,
    DifferenceOf,
    Disc,
    Everywhere,
    IntersectionOf,
    PolygonSet,
    Rectangle,
    Region,
    Sector,
    UnionOf,
    difference,
    intersection,
)
from scenicq.geometry.terms import overlap, rectangle_shape

__all__ = ["SLIVER", "covers", "covers_many", "missed_areas", "overlaps", "surely_covers_many"]

Answer: TypeAlias = bool | None
"""None where it cannot be told: a region removes too many separate discs, or has no end."""

SLIVER = 1e-9
"""Share of a box's area that polygons side by side may leave open between them."""
_EDGE_M = 1e-6
"""How far the edge of a box may stick out of other regions."""
_FAR_M = 1e6
"""Where regions without bounds are looked at for a common point."""


def covers(outer: Region, box: Polygon) -> Answer:
    """Whether a region holds all of a convex polygon, up to slivers: what has no area is not missed.

    Args:
        outer: Any region.
        box: The polygon.
    """
    match outer:
        case Everywhere():
            return True
        case PolygonSet():
            return _together(outer.near(shapes.bounds_of(box)), box)
        case Disc():
            return all(math.dist(outer.center, corner) <= outer.radius for corner in box.exterior.coords)
        case Rectangle():
            return _together([rectangle_shape(outer)], box)
        case IntersectionOf():
            answers = [covers(part, box) for part in outer.parts]
            return False if False in answers else None if None in answers else True
        case UnionOf() if all(isinstance(part, PolygonSet) for part in outer.parts):
            sets = (part for part in outer.parts if isinstance(part, PolygonSet))
            return _together([piece for part in sets for piece in part.near(shapes.bounds_of(box))], box)
        case _:
            inner = box.buffer(-_EDGE_M)
            outside = meets(difference(Everywhere(), outer), box if inner.is_empty else inner)
            return None if outside is None else not outside


def covers_many(outer: PolygonSet, boxes: NDArray[np.object_]) -> NDArray[np.bool_]:
    """`covers` for an array (n,) of convex polygons; a boolean array (n,)."""
    return missed_areas(outer, boxes) <= SLIVER * shapes.areas(boxes)


def missed_areas(outer: PolygonSet, boxes: NDArray[np.object_]) -> NDArray[np.float64]:
    """The area in square metres of each of some convex polygons (n,) that does not lie in the region, (n,)."""
    owner, hit = shapes.tree_pairs(outer.tree, boxes)
    pieces, count = shapes.array(outer.pieces), np.bincount(owner, minlength=len(boxes))
    whole = shapes.areas(boxes)
    missed = np.where(count == 0, whole, 0.0)
    alone = count[owner] == 1
    missed[owner[alone]] = shapes.areas(shapes.difference_many(boxes[owner[alone]], pieces[hit[alone]]))
    for number in np.flatnonzero(count > 1).tolist():
        missed[number] = shapes.difference(boxes[number], _joined(pieces, hit[owner == number])).area
    return missed


def _joined(pieces: NDArray[np.object_], some: NDArray[np.intp]) -> shapes.Shape:
    """Some pieces as one shape, in their order, on which its rounding hangs."""
    return shapes.union_all(pieces[np.sort(some)].tolist())


def surely_covers_many(outer: Region, boxes: NDArray[np.object_]) -> NDArray[np.bool_]:
    """Whether no point of convex polygons (n,) of equally many corners lies outside of a region, (n,).

    It may be false where it is not known, such as across pieces that leave slivers open between them.
    """
    found = np.zeros(len(boxes), dtype=bool)
    match outer:
        case Everywhere():
            return ~found
        case PolygonSet():
            owner, hit = shapes.tree_pairs(outer.tree, boxes)
            pieces, count = shapes.array(outer.pieces), np.bincount(owner, minlength=len(boxes))
            found[owner[shapes.covers_many(pieces[hit], boxes[owner])]] = True
            for number in np.flatnonzero(~found & (count > 1)).tolist():
                found[number] = shapes.covers(_joined(pieces, hit[owner == number]), boxes[number])
        case Disc() | Rectangle():
            found = _holds_corners(outer, boxes)
        case Sector() if outer.angle <= math.pi:
            found = _holds_corners(outer, boxes)
        case UnionOf():
            for part in outer.parts:
                found[~found] = surely_covers_many(part, boxes[~found])
        case IntersectionOf():
            found = ~found
            for part in outer.parts:
                found[found] = surely_covers_many(part, boxes[found])
        case DifferenceOf():
            found = surely_covers_many(outer.base, boxes)
            found[found] = ~meets_many(outer.removed, boxes[found], np.zeros(int(found.sum())))
        case _:
            pass
    return found


def _holds_corners(convex: Disc | Rectangle | Sector, boxes: NDArray[np.object_]) -> NDArray[np.bool_]:
    """Whether all corners of polygons (n,) lie in a convex region, a little less of the slack left than others have."""
    corners = shapes.coordinates_of_many(boxes)
    inside = may_be_within(convex, corners.reshape(-1, 2), -SLACK / 2)
    return np.logical_and.reduce(inside.reshape(corners.shape[:2]), axis=1)


def _together(pieces: Sequence[shapes.Shape], box: Polygon) -> bool:
    return shapes.difference(box, shapes.union_all(pieces)).area <= SLIVER * box.area


def overlaps(left: Region, right: Region) -> Answer:
    """Whether two regions share a point; touching is enough."""
    for one, other in ((left, right), (right, left)):
        match one:
            case Rectangle():
                answers = [meets(other, rectangle_shape(one))]
            case Disc():
                answers = [meets(other, shapes.point(*one.center), one.radius)]
            case PolygonSet():
                answers = [meets(other, polygon) for polygon in one.polygons]
            case _:
                continue
        answer = True if True in answers else None if None in answers else False
        if answer is not None:
            return answer
    west, south, east, north = overlap(bounds(left), bounds(right))
    if west > east + _EDGE_M or south > north + _EDGE_M:
        return False
    both = intersection(left, right)
    if not math.isfinite(east - west + north - south):
        return meets(both, shapes.box(-_FAR_M, -_FAR_M, _FAR_M, _FAR_M)) or None
    return meets(both, shapes.box(west - 1.0, south - 1.0, east + 1.0, north + 1.0))
