"""Pruning by containment: a random point that is the centre of a box inside a container (language paper, section 5.2).

The box holds a disc of half its smaller side around the centre: the centre lies in the container eroded by that much.
A uniform point of a region, given that it lies in a part, is a uniform point of the part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

from shapely.geometry import Polygon

from scenicq.forest.bounds import scalar_bounds
from scenicq.forest.nodes import Constant, Encloses, Identity, Node, PointIn, RectangleAt
from scenicq.forest.walk import transform
from scenicq.geometry import shapes
from scenicq.geometry.boxes import box_polygon
from scenicq.geometry.regions import PolygonSet, Rectangle, Region, UnionOf
from scenicq.geometry.shapes import Shape

__all__ = ["shrink_regions"]

_SPARE = 1e-3
"""Metres by which less is cut off, because a box may stick out by a sliver."""


def shrink_regions(roots: Sequence[Node], hold: Sequence[bool]) -> tuple[tuple[Node, ...], tuple[int, ...]]:
    """Cut the regions of random points to where conditions can hold.

    Args:
        roots: Expressions over the same random variables.
        hold: Whether each of the first ones is a condition that must hold.

    Returns:
        The expressions over smaller regions, and the indices of the conditions that leave nothing of a region.
    """
    asking: dict[Identity, list[int]] = {}
    wanted: dict[Identity, dict[tuple[int, float], Region]] = {}
    points: dict[Identity, PointIn] = {}
    for number, (node, sure) in enumerate(zip(roots, hold, strict=False)):
        if sure and isinstance(node, Encloses) and isinstance(node.inner, RectangleAt):
            point, outer = node.inner.center, node.outer
            half = min(max(scalar_bounds(side)[0], 0.0) / 2 for side in (node.inner.width, node.inner.length)) - _SPARE
            if isinstance(point, PointIn) and isinstance(point.region, Constant) and isinstance(outer, Constant):
                container = cast(Region, outer.value)
                wanted.setdefault(point.identity, {})[id(container), max(half, 0.0)] = container
                points[point.identity] = point
                asking.setdefault(point.identity, []).append(number)
    cutter = _Cutter()
    cut = {identity: cutter.cut(cast(Constant, points[identity].region), asked) for identity, asked in wanted.items()}
    barren = [identity for identity, smaller in cut.items() if smaller and not cast(PolygonSet, smaller.value).polygons]
    memo: dict[int, Node] = {}

    def step(node: Node) -> Node:
        smaller = cut.get(node.identity) if isinstance(node, PointIn) else None
        return node if smaller is None else replace(cast(PointIn, node), region=smaller)

    return (
        tuple(transform(root, step, memo) for root in roots),
        tuple(number for identity in barren for number in asking[identity]),
    )


class _Cutter:
    """Cuts regions to eroded containers; what many objects share is computed once."""

    def __init__(self) -> None:
        self.eroded: dict[tuple[int, float], Shape | None] = {}
        self.results: dict[tuple[int, frozenset[tuple[int, float]]], Constant | None] = {}

    def cut(self, region: Constant, asked: dict[tuple[int, float], Region]) -> Constant | None:
        """The region cut to containers, each eroded by a length; None where that is not known."""
        key = (id(region.value), frozenset(asked))
        if key not in self.results:
            self.results[key] = self._cut(region, asked)
        return self.results[key]

    def _cut(self, region: Constant, asked: dict[tuple[int, float], Region]) -> Constant | None:
        area = _area(cast(Region, region.value))
        if area is None:
            return None
        for (number, by), container in asked.items():
            if (number, by) not in self.eroded:
                outer = _area(container)
                self.eroded[number, by] = None if outer is None else shapes.erode(outer, by)
            inner = self.eroded[number, by]
            area = area if inner is None else shapes.intersection(area, inner)
        parts = cast("tuple[Polygon, ...]", shapes.polygonal_part(area))
        return replace(region, value=PolygonSet(parts, "what a container leaves"))


def _area(region: Region) -> Shape | None:
    """A region as one shape, where it is made of polygons."""
    found: list[Shape] = []
    todo = [region]
    while todo:
        match todo.pop():
            case PolygonSet(pieces=pieces):
                found.append(shapes.union_all(pieces))
            case Rectangle() as box:
                found.append(box_polygon(*box.center, box.heading, box.width, box.length))
            case UnionOf(parts=parts):
                todo += reversed(parts)
            case _:
                return None
    return found[0] if len(found) == 1 else shapes.union_all(found)
