"""Pruning by distance: a random point that must come close to another is drawn close (language paper, section 5.2).

Where a condition holds only if a point P, uniform in a region, lies within r of a point C that is drawn before it, P is
drawn in a window around C instead, a polygon W that holds the disc of radius r. So that scenes keep their
distribution, C then counts only in proportion to the mass of the region in W: with p(C) the density of C, p(C) m(C) / M
times 1 / m(C) is p(C) / M at every pair that the condition allows, with M no smaller than any m(C).
"""

from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np

from scenicq.forest.bounds import Box, FloatInterval, scalar_bounds, vector_bounds
from scenicq.forest.nodes import (
    Compare,
    CompareOp,
    Constant,
    Contains,
    DiscAt,
    Identity,
    Intersects,
    Node,
    Norm,
    PointIn,
    RectangleAt,
    RegionIntersection,
    Scale,
    SectorAt,
    VectorSum,
)
from scenicq.forest.walk import conjuncts, leaves, transform
from scenicq.geometry import shapes
from scenicq.geometry.regions import PolygonSet, PolylineSet, Region, UnionOf
from scenicq.geometry.sampling import sampler
from scenicq.geometry.shapes import Coordinates
from scenicq.number_ranges import expand_ranges

__all__ = ["Window", "close_boxes", "close_points"]

Vector = tuple[float, float]

_CORNERS = 24
_WORTH = 0.2
"""Windows whose largest mass is a larger share of the region's are not worth their cost."""


@dataclass(frozen=True, eq=False)
class Window:
    """Where a random point is drawn: in a region, close to another point.

    Attributes:
        center: The other point.
        region: The region.
        radius: Metres from the centre within which the point must lie.
    """

    center: Node
    region: PolygonSet | PolylineSet
    radius: float

    @cached_property
    def _outline(self) -> Coordinates:
        """Corners of the window around the origin."""
        angles = np.arange(_CORNERS) * (math.tau / _CORNERS)
        return self.radius / math.cos(math.pi / _CORNERS) * np.stack([np.cos(angles), np.sin(angles)], axis=1)

    @cached_property
    def limit(self) -> float:
        """A mass that the region exceeds in no window: square metres, or metres of lines."""
        if isinstance(self.region, PolygonSet):
            return min(float(shapes.polygon(self._outline).area), self.total)
        return min(_densest(self.region, self.radius / math.cos(math.pi / _CORNERS)), self.total)

    @cached_property
    def total(self) -> float:
        """A mass of the region, counting twice what overlaps."""
        masses = shapes.areas if isinstance(self.region, PolygonSet) else shapes.lengths
        return float(masses(self.region.pieces).sum())

    def draw(self, center: Vector, rng: random.Random) -> Vector | None:
        """A point of the region in the window around a centre; None as often as it holds less than the limit."""
        window = shapes.polygon(self._outline + np.array(center))
        near = self.region.near(shapes.bounds_of(window))
        if not near:
            return None
        cut = [part for part in shapes.intersections(near, window) if not part.is_empty]
        if isinstance(self.region, PolygonSet):
            cut = list(shapes.polygonal_part(shapes.union_all(cut)))
            region, mass = PolygonSet(tuple(cut), self.region.name), float(shapes.areas(cut).sum())  # type: ignore[arg-type]
        else:
            region, mass = PolylineSet(tuple(cut), self.region.name), float(shapes.lengths(cut).sum())  # type: ignore[arg-type]
        if not mass or rng.random() * self.limit >= mass:
            return None
        return sampler(region)(rng)


def _densest(region: PolylineSet, radius: float) -> float:
    """No disc of a radius holds a greater length of the lines: by squares, and those around each."""
    side = radius / 4
    edges = np.concatenate([shapes.edges(piece) for piece in region.pieces])
    along = edges[:, 2:] - edges[:, :2]
    length = np.hypot(along[:, 0], along[:, 1])
    # pieces no longer than a side lie within half of one of their middles
    counts = np.maximum(np.ceil(length / side), 1).astype(int)
    owner = np.repeat(np.arange(len(edges)), counts)
    step = expand_ranges(0, counts)
    middles = edges[owner, :2] + along[owner] * ((step + 0.5) / counts[owner])[:, None]
    squares: Counter[tuple[int, int]] = Counter()
    for (column, row), part in zip(
        np.floor(middles / side).astype(int).tolist(), (length / counts)[owner].tolist(), strict=True
    ):
        squares[column, row] += part
    reach = radius + side / 2
    span = range(-math.ceil(reach / side) - 1, math.ceil(reach / side) + 2)
    # squares of which some point may come close enough to some point of the middle one
    around = [(i, j) for i in span for j in span if math.hypot(max(abs(i) - 1, 0), max(abs(j) - 1, 0)) * side <= reach]
    sums: Counter[tuple[int, int]] = Counter()
    for (column, row), mass in squares.items():
        for i, j in around:
            sums[column + i, row + j] += mass
    return max(sums.values(), default=0.0)


def close_points(
    conditions: Iterable[Node], roots: tuple[Node, ...]
) -> tuple[tuple[Node, ...], dict[Identity, Window]]:
    """Find the random points that conditions hold close to others.

    Args:
        conditions: What must hold.
        roots: All expressions over the random variables; rewritten so that such a point comes after its centre.

    Returns:
        The rewritten roots and the windows of random points.
    """
    order: dict[Identity, int] = {}
    points: dict[Identity, PointIn] = {}
    for leaf in leaves(*roots):
        order.setdefault(leaf.identity, len(order))
        if isinstance(leaf, PointIn):
            points[leaf.identity] = leaf
    chosen: dict[Identity, Window] = {}
    regions: dict[int, Region | None] = {}
    for identity, center, radius in _all_close(conditions, order):
        leaf = points[identity]
        if not isinstance(leaf.region, Constant):
            continue
        region = regions.setdefault(id(leaf.region.value), _flat(cast(Region, leaf.region.value)))
        known = chosen.get(identity)
        if isinstance(region, PolygonSet | PolylineSet) and (known is None or radius < known.radius):
            window = Window(center, region, radius)
            if window.limit < _WORTH * window.total:
                chosen[identity] = window
    return _rewritten(roots, dict(sorted(chosen.items(), key=lambda item: order[item[0]])))


def _flat(region: Region) -> Region | None:
    if isinstance(region, UnionOf) and all(isinstance(part, PolygonSet) for part in region.parts):
        sets = cast("tuple[PolygonSet, ...]", region.parts)
        return PolygonSet(tuple(polygon for part in sets for polygon in part.polygons), "a union")
    return region if isinstance(region, PolygonSet | PolylineSet) and region.pieces else None


def _rewritten(
    roots: tuple[Node, ...], windows: Mapping[Identity, Window]
) -> tuple[tuple[Node, ...], dict[Identity, Window]]:
    memo: dict[int, Node] = {}
    found: dict[Identity, Window] = {}
    new: dict[Identity, Node] = {}

    def step(node: Node) -> Node:
        if not (isinstance(node, PointIn) and node.identity in found):
            return node
        if node.identity not in new:
            window = found[node.identity]
            disc = DiscAt(window.center, Constant(window.radius), span=node.span)
            new[node.identity] = replace(node, region=RegionIntersection((node.region, disc), span=node.span))
        return new[node.identity]

    # a centre depends on random variables of lower order only: what is put into it is there already
    for identity, window in windows.items():
        center = transform(window.center, step, memo)
        found[identity] = replace(window, center=center)
    return tuple(transform(root, step, memo) for root in roots), found


def _all_close(conditions: Iterable[Node], order: Mapping[Identity, int]) -> Iterator[tuple[Identity, Node, float]]:
    """Random points, each with another point and how far they may be apart."""
    for condition in conditions:
        for one, other, distance in _distances(condition):
            if not math.isfinite(distance):
                continue
            for moving, center in ((one, other), (other, one)):
                last = max((order[leaf.identity] for leaf in leaves(center)), default=-1)
                for leaf, away in _anchors(moving):
                    if order[leaf.identity] > last and math.isfinite(away):
                        yield leaf.identity, center, distance + away


def close_boxes(condition: Node) -> Iterator[tuple[Node, Box]]:
    """Points that a condition holds close to a known place, each with a box around that place."""
    for part in conjuncts(condition):
        for one, other, away in _distances(part):
            for point, center in ((one, other), (other, one)):
                if isinstance(center, Constant) and not isinstance(point, Constant) and math.isfinite(away):
                    x, y = cast("tuple[float, float]", center.value)
                    yield point, ((x - away, x + away), (y - away, y + away))


def _distances(node: Node) -> Iterator[tuple[Node, Node, float]]:
    """Pairs of points that a condition holds only within a distance of each other."""
    match node:
        case Intersects():
            for view, box in ((node.left, node.right), (node.right, node.left)):
                if isinstance(view, DiscAt | SectorAt) and isinstance(box, RectangleAt):
                    half = math.hypot(*(_largest(scalar_bounds(side)) / 2 for side in (box.width, box.length)))
                    yield box.center, view.center, scalar_bounds(view.radius)[1] + half
        case Contains() if isinstance(node.region, DiscAt | SectorAt):
            yield node.point, node.region.center, scalar_bounds(node.region.radius)[1]
        case Compare():
            small, large = (node.left, node.right) if node.op in _LESS else (node.right, node.left)
            if node.op in _LESS | _MORE and isinstance(small, Norm):
                pair = _difference(small.vector)
                if pair is not None:
                    yield *pair, scalar_bounds(large)[1]
        case _:
            pass


_LESS = {CompareOp.LT, CompareOp.LE}
_MORE = {CompareOp.GT, CompareOp.GE}


def _largest(interval: FloatInterval) -> float:
    return max(abs(interval[0]), abs(interval[1]))


def _difference(node: Node) -> tuple[Node, Node] | None:
    """The vectors of which a vector is the difference."""
    if isinstance(node, VectorSum):
        for one, other in ((node.left, node.right), (node.right, node.left)):
            if isinstance(other, Scale) and isinstance(other.factor, Constant) and other.factor.value == -1.0:
                return one, other.vector
            if isinstance(other, Constant):
                x, y = cast("tuple[float, float]", other.value)
                return one, Constant((-x, -y), span=other.span)
    return None


def _anchors(node: Node) -> Iterator[tuple[PointIn, float]]:
    """Random points that a vector stays close to, with the distance that it keeps."""
    todo: list[tuple[Node, float]] = [(node, 0.0)]
    while todo:
        vector, away = todo.pop()
        if isinstance(vector, PointIn):
            yield vector, away
        elif isinstance(vector, VectorSum):
            for one, other in ((vector.left, vector.right), (vector.right, vector.left)):
                reach = math.hypot(*map(_largest, vector_bounds(other)))
                todo.append((one, away + reach))
