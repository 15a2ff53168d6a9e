"""Collisions: that no two boxes of solid objects overlap (language paper, section 5.4); touching is allowed."""

from __future__ import annotations

from collections.abc import Mapping

from scenicq.forest import build
from scenicq.forest.nodes import ArithmeticOp, Feature, Intersects, Logic, LogicOp, Node, RectangleAt
from scenicq.forest.scenario import BuiltIn, Requirement, Scenario

__all__ = ["boxes", "no_overlap"]

_TOUCHING = 1e-4
"""The share of a size by which boxes may overlap: `ahead of ego` puts one box against the other, up to rounding."""


def boxes(scenario: Scenario) -> dict[int, RectangleAt]:
    """The boxes of the objects that do not allow collisions, by index, over their features, and a hair smaller."""
    return {
        index: RectangleAt(
            Feature(index, "position", "vector"),
            Feature(index, "heading", "scalar"),
            _smaller(Feature(index, "width", "scalar")),
            _smaller(Feature(index, "length", "scalar")),
        )
        for index in scenario.solid
    }


def _smaller(size: Node) -> Node:
    return build.arithmetic(ArithmeticOp.MUL, size, build.constant(1 - _TOUCHING))


def no_overlap(scenario: Scenario, frames: Mapping[int, RectangleAt], first: int, second: int) -> Requirement:
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
