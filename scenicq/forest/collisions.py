"""Collisions: that no two boxes of solid objects overlap (language paper, section 5.4)."""

from __future__ import annotations

from collections.abc import Mapping

from scenicq.forest.nodes import Feature, Intersects, Logic, LogicOp, RectangleAt
from scenicq.forest.scenario import BuiltIn, Requirement, Scenario

__all__ = ["apart", "boxes"]


def boxes(scenario: Scenario) -> dict[int, RectangleAt]:
    """The boxes of the objects that do not allow collisions, by index, over their features."""
    return {
        index: RectangleAt(
            Feature(index, "position", "vector"),
            *(Feature(index, name, "scalar") for name in ("heading", "width", "length")),
        )
        for index in scenario.solid
    }


def apart(scenario: Scenario, frames: Mapping[int, RectangleAt], first: int, second: int) -> Requirement:
    """That two objects do not overlap.

    Args:
        scenario: The scenario.
        frames: The `boxes` of its solid objects.
        first: Index of an object.
        second: Index of another one.
    """
    span = scenario.objects[second].span
    overlap = Intersects(frames[first], frames[second], span=span)
    return Requirement(Logic(LogicOp.NOT, (overlap,), span=span), span, BuiltIn.COLLISION, (first, second))
