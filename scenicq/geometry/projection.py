"""The nearest points of a region to many points at once, where only a part of the region comes into question."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import STRtree

from scenicq.budget import look
from scenicq.errors import CannotEvaluate
from scenicq.geometry import shapes
from scenicq.geometry.closest import nearest_on_circles
from scenicq.geometry.membership import bounds, contains_many, nearest_point
from scenicq.geometry.outlines import outline
from scenicq.geometry.regions import Disc, Everywhere, PointSet, PolygonSet, PolylineSet, Region, UnionOf
from scenicq.geometry.shapes import Bounds, Coordinates
from scenicq.geometry.terms import overlap

__all__ = ["nearest_points"]

_SEVERAL = 4
"""Points from which on it takes less time to make polygons for a region than to ask it about each."""


def nearest_points(region: Region, xy: Coordinates, near: Bounds) -> Coordinates:
    """The points of a region that are nearest to some points; not a number where there is none.

    Args:
        region: The region.
        xy: The points, (n, 2).
        near: The box whose parts of the region come into question; shapes that meet it count whole.
    """
    best = np.full(xy.shape, np.nan)
    least = np.full(len(xy), np.inf)
    todo, sets = [region], list[PolygonSet | PolylineSet | PointSet]()
    while todo:
        part = todo.pop()
        match part:
            case UnionOf():
                todo += reversed(part.parts)
                continue
            case PolygonSet() | PolylineSet() | PointSet():
                sets.append(part)
                continue
            case Everywhere():
                return xy
            case Disc():
                found = _of_disc(part, xy)
            case _:
                found = _of_outline(part, xy, near)
        _take_nearer(xy, found, best, least)
    for each in sets:
        _take_nearer(xy, _of_pieces(*_pieces(each, near), xy), best, least)
    return best


def _take_nearer(xy: Coordinates, found: Coordinates, best: Coordinates, least: NDArray[np.float64]) -> None:
    """Put points in the place of farther ones."""
    away = np.hypot(*(found - xy).T)
    nearer = away < least
    best[nearer], least[nearer] = found[nearer], away[nearer]


@lru_cache(maxsize=1024)
def _pieces(region: PolygonSet | PolylineSet | PointSet, near: Bounds) -> tuple[STRtree, NDArray[Any]]:
    """The shapes of a set that meet a box, and a tree of them."""
    if not np.isfinite(near).all():
        return region.tree, shapes.array(region.pieces)
    pieces = region.near(near)
    return STRtree(pieces), shapes.array(pieces)


def _of_pieces(tree: STRtree, pieces: NDArray[Any], xy: Coordinates) -> Coordinates:
    found = np.full(xy.shape, np.nan)
    if len(pieces):
        points = shapes.points(xy)
        owner, piece, _ = shapes.tree_nearest(tree, points)
        found[owner] = shapes.nearest_of(pieces[piece], points[owner])
    return found


def _of_disc(disc: Disc, xy: Coordinates) -> Coordinates:
    if disc.radius < 0:
        return np.full(xy.shape, np.nan)
    edge = nearest_on_circles(xy, np.array([[*disc.center, disc.radius]]))
    return np.where(contains_many(disc, xy)[:, None], xy, edge)


@lru_cache(maxsize=64)
def _outline(region: Region, near: Bounds) -> tuple[STRtree, NDArray[Any]] | None:
    """Polygons, lines and points that hold a region within a box; None where neither has an end."""
    west, south, east, north = overlap(near, bounds(region))
    if not np.isfinite([west, south, east, north]).all():
        return None
    pieces = outline(region, (west, south, east, north)) if west <= east and south <= north else []
    return STRtree(pieces), shapes.array(pieces)


def _of_outline(region: Region, xy: Coordinates, near: Bounds) -> Coordinates:
    """The nearest points by polygons that hold the region; exactly where these are not of the region."""
    held = _outline(region, near) if len(xy) >= _SEVERAL else None
    if held is None:
        return _one_by_one(region, xy)
    found = _of_pieces(*held, xy)
    there = np.flatnonzero(~np.isnan(found[:, 0]))
    beyond = there[~contains_many(region, found[there])]
    found[beyond] = _one_by_one(region, xy[beyond])
    return found


def _one_by_one(region: Region, xy: Coordinates) -> Coordinates:
    found = np.full(xy.shape, np.nan)
    for number, (x, y) in enumerate(xy.tolist()):
        look()
        try:
            point = nearest_point(region, x, y)
        except CannotEvaluate:
            return found
        if point is not None:
            found[number] = point
    return found
