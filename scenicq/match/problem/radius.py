"""The radius of a match: only the map near the ego counts (query paper, section 5.2.2, "visible distance")."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from scenicq.forest.nodes import Constant, Node, PointIn, RegionIntersection
from scenicq.forest.walk import transform
from scenicq.geometry.regions import Disc, Region, intersection
from scenicq.match.problem.conditioned import Item

__all__ = ["within_radius"]


def within_radius(items: list[Item], center: tuple[float, float], radius: float) -> list[Item]:
    """The constraints with every random point kept within a radius of a centre, in metres."""
    disc = Disc(center, radius)

    def step(node: Node) -> Node:
        if not isinstance(node, PointIn):
            return node
        if isinstance(node.region, Constant):
            region = intersection(cast(Region, node.region.value), disc)
            return replace(node, region=Constant(region, span=node.region.span))
        return replace(node, region=RegionIntersection((node.region, Constant(disc)), span=node.region.span))

    memo: dict[int, Node] = {}
    return [(constraint, transform(node, step, memo), value) for constraint, node, value in items]
