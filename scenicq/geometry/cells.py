"""Polygonal regions as triangles and as convex cells: the disjuncts of a formula that places a point in a region."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry import shapes
from scenicq.geometry.membership import bounds as bounds_of_region
from scenicq.geometry.regions import Nowhere, PolygonSet, Rectangle, Region, UnionOf
from scenicq.geometry.shapes import Bounds, Shape
from scenicq.geometry.terms import overlap, rectangle_shape, terms

__all__ = ["convex_cells", "convex_parts", "joined_boxes", "triangles"]

_STRAIGHT = 1e-12
"""Sine of a corner's turn down to which it still counts as straight."""


def triangles(region: Region, bounds: Bounds) -> list[NDArray[np.float64]]:
    """Triangles, shape (3, 2), counter-clockwise, of the polygons of a region whose boxes meet the given bounds.

    Sets of polygons, rectangles and unions of these keep their polygons whole, so that the answer can be cached;
    combinations of them are cut to the bounds.

    Raises:
        ValueError: The region is not polygonal: it holds a disc, a sector, lines or points.
    """
    return [triangle for shape in _polygons(region, bounds) for triangle in _triangles(shape)]


def convex_cells(region: Region, bounds: Bounds) -> list[NDArray[np.float64]]:
    """The same as `triangles`, merged into fewer convex pieces, each (k, 2), counter-clockwise.

    Raises:
        ValueError: The region is not polygonal.
    """
    return [cell for shape in _polygons(region, bounds) for cell in convex_parts(shape)]


@lru_cache(maxsize=65536)
def convex_parts(shape: Shape) -> tuple[NDArray[np.float64], ...]:
    """The convex pieces, each (k, 2), counter-clockwise, of one polygon: its triangles, greedily merged."""
    outlines = [[(float(x), float(y)) for x, y in triangle] for triangle in _triangles(shape)]
    alive: dict[int, list[tuple[float, float]]] = dict(enumerate(outlines))
    owner = {edge: number for number, outline in alive.items() for edge in _edges(outline)}
    # longest diagonals first: they separate the widest pieces
    inner = [edge for edge in owner if edge[0] < edge[1] and (edge[1], edge[0]) in owner]
    inner.sort(key=lambda edge: -((edge[0][0] - edge[1][0]) ** 2 + (edge[0][1] - edge[1][1]) ** 2))
    for edge in inner:
        first, second = owner[edge], owner[edge[1], edge[0]]
        if first == second:
            continue
        merged = _merged(alive[first], alive[second], edge)
        if merged is None:
            continue
        alive[first] = merged
        del alive[second]
        for other in _edges(merged):
            owner[other] = first
    return tuple(np.array(outline) for outline in alive.values())


_XY = tuple[float, float]


def _edges(outline: list[_XY]) -> list[tuple[_XY, _XY]]:
    return list(zip(outline, outline[1:] + outline[:1], strict=True))


def _merged(a: list[_XY], b: list[_XY], edge: tuple[_XY, _XY]) -> list[_XY] | None:
    """Two convex outlines joined along an edge of the first, or None if the result isn't convex."""
    start, end = a.index(edge[1]), b.index(edge[0])
    # from the edge's end round to its start in a, then on round b without the shared corners
    joined = a[start:] + a[:start] + (b[end:] + b[:end])[1:-1]
    size = len(joined)
    for place in (0, len(a) - 1):
        (x0, y0), (x1, y1), (x2, y2) = joined[place - 1], joined[place], joined[(place + 1) % size]
        turn = (x1 - x0) * (y2 - y1) - (y1 - y0) * (x2 - x1)
        scale = np.hypot(x1 - x0, y1 - y0) * np.hypot(x2 - x1, y2 - y1)
        if turn < -_STRAIGHT * scale:
            return None
    return joined


@lru_cache(maxsize=65536)
def _triangles(shape: Shape) -> tuple[NDArray[np.float64], ...]:
    return tuple(shapes.triangulate(shapes.without_straight_corners(shape)))


def _polygons(region: Region, bounds: Bounds) -> list[Shape]:
    match region:
        case Nowhere():
            return []
        case PolygonSet():
            return region.near(bounds)
        case Rectangle():
            west, south, east, north = overlap(bounds, bounds_of_region(region))
            return [rectangle_shape(region)] if west <= east and south <= north else []
        case UnionOf():
            return [shape for part in region.parts for shape in _polygons(part, bounds)]
        case _:
            found = list(terms(region, bounds))
            if any(term.inside or term.outside or not shapes.polygonal_part(term.clip) for term in found):
                raise ValueError("the region is not polygonal")
            return [part for term in found for part in shapes.polygonal_part(term.clip)]


def joined_boxes(squares: Iterable[Bounds]) -> list[Bounds]:
    """The same area in fewer boxes: runs from west to east first, then equal runs from south to north."""
    runs: list[Bounds] = []
    for west, south, east, north in sorted(squares, key=lambda box: (box[1], box[3], box[0])):
        if runs and runs[-1][1:] == (south, west, north):
            runs[-1] = (runs[-1][0], south, east, north)
        else:
            runs.append((west, south, east, north))
    stacks: list[Bounds] = []
    for west, south, east, north in sorted(runs, key=lambda box: (box[0], box[2], box[1])):
        if stacks and (stacks[-1][0], stacks[-1][2], stacks[-1][3]) == (west, east, south):
            stacks[-1] = (west, stacks[-1][1], east, north)
        else:
            stacks.append((west, south, east, north))
    return stacks
