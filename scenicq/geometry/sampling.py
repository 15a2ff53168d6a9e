"""Uniform points of a region: by area, length or number, whichever is the region's own measure."""

from __future__ import annotations

import math
import random
from bisect import bisect
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import accumulate
from typing import assert_never, cast

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon

from scenicq.budget import look
from scenicq.errors import CannotEvaluate
from scenicq.geometry import shapes
from scenicq.geometry.angles import direction, rotate
from scenicq.geometry.membership import bounds, contains
from scenicq.geometry.outlines import disc_outline, sector_outline
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
from scenicq.geometry.shapes import XY
from scenicq.geometry.terms import Term, terms
from scenicq.limits import LIMITS

__all__ = ["sample", "sampler"]


@dataclass(frozen=True, slots=True)
class _Proposal:
    """A way to draw from a region: each try gives a point, with the same density 1 / mass everywhere, or nothing."""

    dimension: int
    mass: float
    draw: Callable[[random.Random], XY | None]


def sample(region: Region, rng: random.Random) -> XY:
    """A point drawn uniformly from a region (from the parts of highest dimension, where they differ).

    Raises:
        ValueError: "empty", when the region is empty or too small in its parts to be hit; "unbounded", when it has no
            uniform distribution.
    """
    return sampler(region)(rng)


def sampler(region: Region) -> Callable[[random.Random], XY]:
    """What draws from a region again and again, prepared once; see `sample`.

    Raises:
        ValueError: As `sample`. A drawing may raise "empty", too.
    """
    proposal = _proposal(region)
    if proposal is None:
        raise ValueError("empty")

    def closer() -> _Proposal | None:
        cut = _cut_to_window(region)
        return proposal if cut is None else _filtered(cut, region)

    ways = [
        (lambda: proposal, LIMITS.whole_draws),
        (cache(closer), LIMITS.cut_draws),
        (cache(lambda: _apart(region, proposal)), LIMITS.part_draws),
    ]

    def draw(rng: random.Random) -> XY:
        while ways:
            way, tries = ways[0]
            found = way()
            point = None if found is None else _tried(found, rng, tries)
            if point is not None:
                return point
            # a way that failed once is not gone again
            del ways[: len(ways) if found is None else 1]
        raise ValueError("empty")

    return draw


def _tried(proposal: _Proposal, rng: random.Random, tries: int) -> XY | None:
    for _ in range(tries):
        point = proposal.draw(rng)
        if point is not None:
            return point
        look()
    return None


def _cut_to_window(region: Region) -> Region | None:
    """The polygons of an intersection, cut to a disc or sector that is smaller: it may miss most of them, or all."""
    if not isinstance(region, IntersectionOf):
        return None
    smallest = min(region.parts, key=_size)
    sets = [part for part in region.parts if isinstance(part, PolygonSet)]
    if not sets or not isinstance(smallest, Disc | Sector):
        return None
    base = min(sets, key=_size)
    near = cast("list[Polygon]", base.near(bounds(smallest)))
    return _clipped(PolygonSet(tuple(near), base.name), region.parts)


def _apart(region: Region, proposal: _Proposal) -> _Proposal | None:
    """What draws from exactly the parts of a region, up to its arcs; None if it has none, else the way known so far."""
    west, south, east, north = bounds(region)
    if west > east or south > north:
        return None
    if proposal.dimension == 0 or not math.isfinite(east - west + north - south):
        return proposal
    try:
        pieces = shapes.simple_parts([_straightened(term) for term in terms(region, (west, south, east, north))])
    except CannotEvaluate:
        return proposal
    if proposal.dimension == 1:
        lines = tuple(piece for piece in pieces if isinstance(piece, LineString))
        return _filtered(PolylineSet(lines, "parts"), region)
    return _filtered(PolygonSet(tuple(piece for piece in pieces if isinstance(piece, Polygon)), "parts"), region)


def _straightened(term: Term) -> shapes.Shape:
    """A shape that holds a term, with polygons for its circles."""
    shape = term.clip
    for circle in term.inside:
        shape = shapes.intersection(shape, disc_outline(circle.x, circle.y, circle.radius, "outer"))
    for circle in term.outside:
        shape = shapes.difference(shape, disc_outline(circle.x, circle.y, circle.radius, "inner"))
    return shape


def _proposal(region: Region) -> _Proposal | None:
    match region:
        case Everywhere():
            raise ValueError("unbounded")
        case Nowhere():
            return None
        case Disc():
            return _sector(Sector(region.center, region.radius, 0.0, math.tau))
        case Sector():
            return _sector(region)
        case Rectangle():
            return _rectangle(region)
        case PolygonSet():
            return _polygons(region)
        case PolylineSet():
            return _polylines(region)
        case PointSet():
            points = region.points
            return _Proposal(0, len(points), lambda rng: points[rng.randrange(len(points))]) if points else None
        case UnionOf():
            return _union(region.parts)
        case IntersectionOf():
            return _filtered(_clipped(min(region.parts, key=_size), region.parts), region)
        case DifferenceOf():
            return _filtered(region.base, region)
        case _:
            assert_never(region)


def _size(region: Region) -> tuple[bool, float]:
    """Sort key: lines and points first, then small boxes."""
    west, south, east, north = bounds(region)
    area = max(east - west, 0.0) * max(north - south, 0.0)
    return not isinstance(region, PolylineSet | PointSet), area if math.isfinite(area) else math.inf


def _clipped(source: Region, parts: tuple[Region, ...]) -> Region:
    """The part of a set of shapes that can lie in the discs and sectors among the parts."""
    if not isinstance(source, PolygonSet | PolylineSet):
        return source
    pieces = list(source.pieces)
    for window in (_window(part) for part in parts):
        if window is not None:
            pieces = [cut for piece in pieces if not (cut := shapes.intersection(piece, window)).is_empty]
    if isinstance(source, PolylineSet):
        lines = tuple(piece for piece in shapes.simple_parts(pieces) if isinstance(piece, LineString))
        return PolylineSet(lines, source.name)
    polygons = tuple(piece for piece in shapes.simple_parts(pieces) if isinstance(piece, Polygon))
    return PolygonSet(polygons, source.name)


def _window(region: Region) -> shapes.Shape | None:
    """A polygon that holds a disc or sector, with little to spare; None for other regions."""
    match region:
        case Disc():
            return disc_outline(*region.center, region.radius, "outer")
        case Sector():
            return sector_outline(region, "outer")
        case _:
            return None


def _filtered(source: Region, region: Region) -> _Proposal | None:
    proposal = _proposal(source)
    if proposal is None:
        return None
    draw = proposal.draw

    def attempt(rng: random.Random) -> XY | None:
        point = draw(rng)
        return point if point is not None and contains(region, *point) else None

    return _Proposal(proposal.dimension, proposal.mass, attempt)


def _union(parts: tuple[Region, ...]) -> _Proposal | None:
    pairs = [(part, proposal) for part in parts if (proposal := _proposal(part)) is not None]
    top = max((proposal.dimension for _, proposal in pairs), default=0)
    pairs = [(part, proposal) for part, proposal in pairs if proposal.dimension == top]
    if not pairs:
        return None
    sums = list(accumulate(proposal.mass for _, proposal in pairs))

    def draw(rng: random.Random) -> XY | None:
        point = pairs[_chosen(sums, rng)][1].draw(rng)
        if point is None:
            return None
        # a point of several parts is proposed by each of them
        return point if rng.random() * sum(contains(part, *point) for part, _ in pairs) < 1.0 else None

    return _Proposal(top, sums[-1], draw)


def _sector(sector: Sector) -> _Proposal | None:
    if sector.radius < 0:
        return None
    (x, y), r = sector.center, sector.radius
    angle = min(max(sector.angle, 0.0), math.tau)

    def draw(rng: random.Random) -> XY:
        away = r * math.sqrt(rng.random())
        dx, dy = direction(sector.heading + angle * (rng.random() - 0.5))
        return x + away * dx, y + away * dy

    return _Proposal(2, angle * r * r / 2, draw)


def _rectangle(box: Rectangle) -> _Proposal:
    def draw(rng: random.Random) -> XY:
        dx, dy = rotate((rng.random() - 0.5) * box.width, (rng.random() - 0.5) * box.length, box.heading)
        return box.center[0] + dx, box.center[1] + dy

    return _Proposal(2, box.width * box.length, draw)


def _polygons(region: PolygonSet) -> _Proposal | None:
    if not region.pieces:
        return None
    sums = _running(shapes.areas(region.pieces))
    triangles: dict[int, tuple[list[float], list[list[list[float]]]]] = {}

    def draw(rng: random.Random) -> XY | None:
        index = _chosen(sums, rng)
        if index not in triangles:
            triangles[index] = _triangles(region.pieces[index])
        shares, corners = triangles[index]
        (ax, ay), (bx, by), (cx, cy) = corners[_chosen(shares, rng)]
        u, v = rng.random(), rng.random()
        if u + v > 1.0:
            u, v = 1.0 - u, 1.0 - v
        x, y = ax + u * (bx - ax) + v * (cx - ax), ay + u * (by - ay) + v * (cy - ay)
        several = len(shapes.tree_within(region.tree, shapes.point(x, y), 0.0)) if len(sums) > 1 else 1
        return (x, y) if rng.random() * several < 1.0 else None

    return _Proposal(2, sums[-1], draw)


def _triangles(piece: shapes.Shape) -> tuple[list[float], list[list[list[float]]]]:
    """Triangles that tile a polygon, with the running sums of their areas (doubled)."""
    corners = shapes.triangulate(piece)
    ahead, aside = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return _running(np.abs(ahead[:, 0] * aside[:, 1] - ahead[:, 1] * aside[:, 0])), corners.tolist()


def _polylines(region: PolylineSet) -> _Proposal | None:
    if not region.pieces:
        return None
    edges = np.concatenate([shapes.edges(piece) for piece in region.pieces])
    sums = _running(np.hypot(edges[:, 2] - edges[:, 0], edges[:, 3] - edges[:, 1]))

    def draw(rng: random.Random) -> XY:
        index = _chosen(sums, rng)
        x0, y0, x1, y1 = edges[index].tolist()
        share = rng.random()
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)

    return _Proposal(1, sums[-1], draw)


def _chosen(sums: list[float], rng: random.Random) -> int:
    """An index, drawn in proportion to the steps of its running sums."""
    return min(bisect(sums, rng.random() * sums[-1]), len(sums) - 1)


def _running(masses: NDArray[np.float64]) -> list[float]:
    return list(accumulate(float(mass) for mass in masses))
