"""Where a point is with respect to a region: contains, distance, bounds. Exact, the boundary counts as inside."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry import shapes
from scenicq.geometry.angles import direction, rotate
from scenicq.geometry.boxes import corners
from scenicq.geometry.closest import closest_point
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
from scenicq.geometry.shape_distances import to_discs, to_rectangles, to_sectors
from scenicq.geometry.shapes import XY, Bounds
from scenicq.geometry.terms import overlap, terms

__all__ = [
    "bounds",
    "contains",
    "contains_many",
    "distance",
    "distance_many",
    "may_be_within",
    "nearest_point",
    "parts_near",
]

_FIRST_REACH = 8.0
_LAST_REACH = 1e8
_NEIGHBOURHOOD = 1e-6


def contains(region: Region, x: float, y: float) -> bool:
    """Whether a point lies in a region or within `SLACK` of it."""
    match region:
        case Everywhere():
            return True
        case Nowhere():
            return False
        case Disc() | Sector() | Rectangle():
            return distance(region, x, y) <= SLACK
        case PolygonSet() | PolylineSet() | PointSet():
            return len(shapes.tree_within(region.tree, shapes.point(x, y), SLACK)) > 0
        case UnionOf():
            west, south, east, north = _part_boxes(region)
            near = (west <= x + SLACK) & (south <= y + SLACK) & (east >= x - SLACK) & (north >= y - SLACK)
            return any(contains(region.parts[number], x, y) for number in np.flatnonzero(near).tolist())
        case IntersectionOf():
            return all(contains(part, x, y) for part in region.parts)
        case DifferenceOf():
            if not contains(region.base, x, y):
                return False
            if not contains(region.removed, x, y):
                return True
            # on the boundary of what is removed, or inside of it: the smallest neighbourhood tells
            return _distance_within(region, x, y, _NEIGHBOURHOOD) <= SLACK
        case _:
            assert_never(region)


@lru_cache(maxsize=64)
def _part_boxes(region: UnionOf) -> NDArray[np.float64]:
    """Western, southern, eastern and northern ends of a union's parts, shape (4, parts): maps have hundreds."""
    return np.array([bounds(part) for part in region.parts], dtype=np.float64).reshape(-1, 4).T


def parts_near(region: UnionOf, box: Bounds) -> list[Region]:
    """The parts of a union whose boxes meet the given one, in order."""
    west, south, east, north = _part_boxes(region)
    near = (west <= box[2]) & (east >= box[0]) & (south <= box[3]) & (north >= box[1])
    return [region.parts[index] for index in np.flatnonzero(near).tolist()]


def contains_many(region: Region, xy: NDArray[np.float64]) -> NDArray[np.bool_]:
    """`contains` for points of shape (n, 2); a boolean array (n,)."""
    match region:
        case UnionOf() | IntersectionOf():
            return _filtered(xy, region, contains_many)
        case DifferenceOf():
            result = contains_many(region.base, xy)
            (doubtful,) = np.nonzero(result)
            doubtful = doubtful[contains_many(region.removed, xy[doubtful])]
            result[doubtful] = [contains(region, x, y) for x, y in xy[doubtful].tolist()]
            return result
        case _:
            return may_be_within(region, xy, 0.0)


def may_be_within(region: Region, xy: NDArray[np.float64], reach: float) -> NDArray[np.bool_]:
    """Whether a region may come within a distance of points of shape (n, 2); false only where it does not.

    Args:
        region: The region.
        xy: The points.
        reach: Metres, at least 0.
    """
    match region:
        case Everywhere() | Nowhere():
            return np.full(len(xy), isinstance(region, Everywhere))
        case Disc() | Sector() | Rectangle():
            return _to_shape(region, xy) <= reach + SLACK
        case PolygonSet() | PolylineSet() | PointSet():
            result = np.zeros(len(xy), dtype=bool)
            result[shapes.tree_pairs_within(region.tree, shapes.points(xy), reach + SLACK)[0]] = True
            return result
        case UnionOf() | IntersectionOf():
            return _filtered(xy, region, lambda part, some: may_be_within(part, some, reach))
        case DifferenceOf():
            return may_be_within(region.base, xy, reach)
        case _:
            assert_never(region)


def distance(region: Region, x: float, y: float) -> float:
    """Distance from a point to a region in metres: 0 inside, inf if the region is empty.

    Raises:
        CannotEvaluate: The region removes too many separate discs for an exact answer.
    """
    match region:
        case Everywhere():
            return 0.0
        case Nowhere():
            return math.inf
        case Disc():
            return _to_disc(math.dist((x, y), region.center), region.radius)
        case Sector():
            return _to_sector(region, x, y)
        case Rectangle():
            aside, ahead = rotate(x - region.center[0], y - region.center[1], -region.heading)
            return math.hypot(max(abs(aside) - region.width / 2, 0.0), max(abs(ahead) - region.length / 2, 0.0))
        case PolygonSet() | PolylineSet() | PointSet():
            if not region.pieces:
                return math.inf
            _, _, nearest = shapes.tree_nearest(region.tree, shapes.array([shapes.point(x, y)]))
            # none is nearest to a point so far away that the distance is no number
            return float(nearest[0]) if len(nearest) else math.inf
        case UnionOf():
            return min((distance(part, x, y) for part in region.parts), default=math.inf)
        case IntersectionOf() | DifferenceOf():
            found = nearest_point(region, x, y)
            return math.inf if found is None else math.dist((x, y), found)
        case _:
            assert_never(region)


def distance_many(region: Region, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """`distance` for points of shape (n, 2), (n,).

    Raises:
        CannotEvaluate: As of `distance`, for one of the points.
    """
    match region:
        case PolygonSet() | PolylineSet() | PointSet() if region.pieces:
            found = np.full(len(xy), np.inf)
            owner, _, nearest = shapes.tree_nearest(region.tree, shapes.points(xy))
            found[owner] = nearest
            return found
        case UnionOf() if region.parts:
            return np.min([distance_many(part, xy) for part in region.parts], axis=0)
        case _:
            return np.array([distance(region, x, y) for x, y in xy.tolist()], dtype=np.float64)


def nearest_point(region: Region, x: float, y: float) -> XY | None:
    """The point of a region that is nearest to (x, y), or None if the region is empty.

    Raises:
        CannotEvaluate: The region removes too many separate discs for an exact answer.
    """
    if contains(region, x, y):
        return x, y
    west, south, east, north = bounds(region)
    if west > east or south > north:
        return None
    span = math.hypot(max(x - west, east - x), max(y - south, north - y)) + 1.0
    reach = max(_FIRST_REACH, 2 * math.hypot(max(west - x, x - east, 0.0), max(south - y, y - north, 0.0)))
    while True:
        found = _nearest_within(region, x, y, reach)
        # on the border of the box, what is taken off may end too early
        if found is not None and math.dist((x, y), found) < reach - SLACK:
            return found
        if reach >= min(span, _LAST_REACH):
            return found
        reach *= 4


def bounds(region: Region) -> Bounds:
    """A box around a region: the smallest one, but for combinations; (inf, inf, -inf, -inf) around nothing."""
    match region:
        case Everywhere():
            return -math.inf, -math.inf, math.inf, math.inf
        case Nowhere():
            return math.inf, math.inf, -math.inf, -math.inf
        case Disc():
            (x, y), r = region.center, region.radius
            return x - r, y - r, x + r, y + r
        case Sector():
            return _sector_bounds(region)
        case Rectangle():
            outline = corners(*region.center, region.heading, region.width, region.length)
            (west, south), (east, north) = outline.min(axis=0).tolist(), outline.max(axis=0).tolist()
            return west, south, east, north
        case PolygonSet() | PolylineSet() | PointSet():
            return region.extent
        case UnionOf():
            if not region.parts:
                return bounds(Nowhere())
            west, south, east, north = _part_boxes(region)
            return float(west.min()), float(south.min()), float(east.max()), float(north.max())
        case IntersectionOf():
            box = bounds(Everywhere())
            for part in region.parts:
                box = overlap(box, bounds(part))
            return box if box[0] <= box[2] and box[1] <= box[3] else bounds(Nowhere())
        case DifferenceOf():
            return bounds(region.base)
        case _:
            assert_never(region)


def _to_shape(region: Disc | Sector | Rectangle, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    dx, dy = (xy - np.array(region.center)).T
    match region:
        case Disc():
            return to_discs(dx, dy, region.radius)
        case Sector():
            return to_sectors(dx, dy, region.radius, region.heading, region.angle)
        case Rectangle():
            return to_rectangles(dx, dy, region.heading, region.width, region.length)


def _filtered(
    xy: NDArray[np.float64], region: UnionOf | IntersectionOf,
    holds: Callable[[Region, NDArray[np.float64]], NDArray[np.bool_]],
) -> NDArray[np.bool_]:  # fmt: skip
    """Whether something holds of a part, or of all, each asked only of the points still open."""
    start = isinstance(region, IntersectionOf)
    result = np.full(len(xy), start)
    for part in region.parts:
        (still,) = np.nonzero(result == start)
        result[still] = holds(part, xy[still])
    return result


def _to_disc(from_center: float, radius: float) -> float:
    return max(0.0, from_center - radius) if radius >= 0 else math.inf


def _to_sector(sector: Sector, x: float, y: float) -> float:
    """Folded onto one side of the sector's middle: inside the wedge as to a disc, else as to its bounding radius."""
    if sector.radius < 0:
        return math.inf
    aside, ahead = rotate(x - sector.center[0], y - sector.center[1], -sector.heading)
    aside = abs(aside)
    away = math.hypot(aside, ahead)
    half = max(sector.angle, 0.0) / 2
    if half >= math.pi or math.atan2(aside, ahead) <= half:
        return _to_disc(away, sector.radius)
    dx, dy = math.sin(half), math.cos(half)
    along = min(max(aside * dx + ahead * dy, 0.0), sector.radius)
    return math.hypot(aside - along * dx, ahead - along * dy)


def _sector_bounds(sector: Sector) -> Bounds:
    (x, y), r = sector.center, sector.radius
    half = sector.angle / 2
    if half >= math.pi:
        return x - r, y - r, x + r, y + r
    headings = [sector.heading - half, sector.heading + half]
    quarter = math.pi / 2
    first = math.ceil(headings[0] / quarter)
    headings += [quarter * i for i in range(first, math.floor(headings[1] / quarter) + 1)]
    tips = [(x + r * dx, y + r * dy) for dx, dy in map(direction, headings)] + [(x, y)]
    xs, ys = zip(*tips, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def _nearest_within(region: Region, x: float, y: float, reach: float) -> XY | None:
    near = list(terms(region, (x - reach, y - reach, x + reach, y + reach)))
    # no point of a term is closer than its clip, which takes far less time to tell
    away = shapes.distances(shapes.array([term.clip for term in near]), shapes.point(x, y))
    best: XY | None = None
    order: list[int] = np.argsort(away, kind="stable").tolist()
    for number in order:
        if best is not None and away[number] >= math.dist(best, (x, y)):
            break
        found = closest_point(near[number], x, y)
        if found is not None and (best is None or math.dist(found, (x, y)) < math.dist(best, (x, y))):
            best = found
    return best


def _distance_within(region: Region, x: float, y: float, reach: float) -> float:
    found = _nearest_within(region, x, y, reach)
    return math.inf if found is None else math.dist((x, y), found)
