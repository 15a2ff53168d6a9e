"""Whether a region comes close to a shape: the question behind every feature with a position tolerance.

`meets` is exact: shapes grow by a disc only as far as the answer needs it, and discs stay circles (see `terms`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import assert_never

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Point

from scenicq.errors import CannotEvaluate
from scenicq.geometry import shapes
from scenicq.geometry.closest import closest_point
from scenicq.geometry.membership import contains, distance
from scenicq.geometry.outlines import disc_outline
from scenicq.geometry.regions import (
    SLACK,
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
from scenicq.geometry.terms import Circle, Term, both, rectangle_shape, terms

__all__ = ["meets", "meets_many", "witness_point"]


def meets(region: Region, shape: Shape, radius: float = 0.0) -> bool | None:
    """Whether some point of a region lies within a radius of a shape (in the shape, for radius 0).

    Args:
        region: Any region.
        shape: A valid Point, LineString, Polygon or collection of them.
        radius: Metres, at least 0.

    Returns:
        True or False, exactly up to `SLACK`; None if the region removes too many separate discs to tell.
    """
    if shape.is_empty:
        return False
    try:
        return _meets(region, shape, radius)
    except CannotEvaluate:
        return None


def meets_many(
    region: Region, some: NDArray[np.object_], radius: NDArray[np.float64], *, surely: bool = False
) -> NDArray[np.bool_]:
    """`meets` for shapes and radii (n,), which may be true where it is not known; or, if told so, false; (n,)."""
    match region:
        case PolygonSet() | PolylineSet() | PointSet():
            found = np.zeros(len(some), dtype=bool)
            found[shapes.tree_pairs_within(region.tree, some, radius + SLACK)[0]] = True
            return found
        case Disc() if region.radius >= 0:
            return shapes.distances(some, shapes.point(*region.center)) <= region.radius + radius + SLACK
        case Rectangle():
            return shapes.distances(some, rectangle_shape(region)) <= radius + SLACK
        case UnionOf():
            parts = [meets_many(part, some, radius, surely=surely) for part in region.parts]
            return np.any(parts, axis=0) if parts else np.zeros(len(some), dtype=bool)
        case _:
            answers = [meets(region, shape, reach) for shape, reach in zip(some, radius.tolist(), strict=True)]
            return np.array([not surely if answer is None else answer for answer in answers], dtype=bool)


def witness_point(region: Region, shape: Shape, radius: float = 0.0) -> XY | None:
    """A point of the region within a radius of the shape, or None if there is none (or `meets` can't tell).

    A Point that lies in the region is its own witness; else the witness lies inside both where that is cheap to find.
    """
    if shape.is_empty:
        return None
    if isinstance(shape, Point) and contains(region, shape.x, shape.y):
        return shape.x, shape.y
    best: XY | None = None
    try:
        for term in terms(region, _around(shape, radius)):
            for grown in _grown(shape, radius):
                for shared in both(term, grown):
                    inner = _inner(shared)
                    if inner is not None and contains(region, *inner):
                        return inner
                    best = best or closest_point(shared, *shapes.inner_point(shape))
    except CannotEvaluate:
        return best
    return best


def _meets(region: Region, shape: Shape, radius: float) -> bool:
    limit = radius + SLACK
    match region:
        case Everywhere():
            return True
        case Nowhere():
            return False
        case Disc():
            return region.radius >= 0 and shapes.distance(shapes.point(*region.center), shape) <= region.radius + limit
        case Rectangle():
            return shapes.distance(rectangle_shape(region), shape) <= limit
        case PolygonSet() | PolylineSet() | PointSet():
            return len(shapes.tree_within(region.tree, shape, limit)) > 0
        case UnionOf():
            return _any_part(region.parts, shape, radius)
        case Sector() | IntersectionOf() | DifferenceOf():
            if isinstance(shape, Point):
                return _meets_point(region, shape.x, shape.y, radius)
            return any(_term_meets(term, shape, radius) for term in terms(region, _around(shape, radius)))
        case _:
            assert_never(region)


def _any_part(parts: tuple[Region, ...], shape: Shape, radius: float) -> bool:
    undecided: CannotEvaluate | None = None
    for part in parts:
        try:
            if _meets(part, shape, radius):
                return True
        except CannotEvaluate as error:
            undecided = error
    if undecided is not None:
        raise undecided
    return False


def _meets_point(region: Region, x: float, y: float, radius: float) -> bool:
    if isinstance(region, Sector):
        return distance(region, x, y) <= radius + SLACK
    if contains(region, x, y):
        return True
    if radius == 0:
        return False
    for term in terms(region, _around(shapes.point(x, y), radius)):
        found = closest_point(term, x, y)
        if found is not None and math.dist(found, (x, y)) <= radius + SLACK:
            return True
    return False


def _term_meets(term: Term, shape: Shape, radius: float) -> bool:
    if shapes.distance(term.clip, shape) > radius + SLACK:
        return False
    if not term.inside and not term.outside:
        return True
    x, y = shapes.inner_point(shape)
    return any(
        closest_point(shared, x, y) is not None for grown in _grown(shape, radius) for shared in both(term, grown)
    )


def _grown(shape: Shape, radius: float) -> Iterator[Term]:
    """The points within a radius of a shape: the shape, a strip along each edge, a disc around each corner."""
    yield Term(shape)
    if radius <= 0:
        return
    edges = shapes.edges(shape)
    for x0, y0, x1, y1 in edges.tolist():
        length = math.hypot(x1 - x0, y1 - y0)
        if length > 0:
            dx, dy = -(y1 - y0) / length * radius, (x1 - x0) / length * radius
            yield Term(shapes.polygon([(x0 - dx, y0 - dy), (x1 - dx, y1 - dy), (x1 + dx, y1 + dy), (x0 + dx, y0 + dy)]))
    for x, y in dict.fromkeys([(x, y) for x, y, _, _ in edges.tolist()] + [(x, y) for _, _, x, y in edges.tolist()]):
        yield Term(shapes.box(x - radius, y - radius, x + radius, y + radius), (Circle(x, y, radius),))


def _around(shape: Shape, radius: float) -> Bounds:
    west, south, east, north = shapes.bounds_of(shape)
    reach = radius + 1e-3
    return west - reach, south - reach, east + reach, north + reach


def _inner(term: Term) -> XY | None:
    """A point well inside a term, from polygons inscribed in its circles, if these leave an area."""
    rest = term.clip
    for circle in term.inside:
        rest = shapes.intersection(rest, disc_outline(circle.x, circle.y, circle.radius, "inner"))
    for circle in term.outside:
        rest = shapes.difference(rest, disc_outline(circle.x, circle.y, circle.radius, "outer"))
    pieces = shapes.polygonal_part(rest)
    if not pieces:
        return None
    largest = max(pieces, key=lambda piece: piece.area)
    return shapes.inner_point(largest)
