"""Comparing known values: the exact first step of the decision ladder, and the replay of witnesses."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import cast

from scenicq.forest.compute import CannotEvaluate
from scenicq.forest.evaluate import admits, evaluate_all
from scenicq.forest.groups import Comparison, Constraint
from scenicq.forest.nodes import DirectionAt, Identity, Leaf, Node, Undefined, Value
from scenicq.forest.walk import children, is_leaf, postorder
from scenicq.geometry.angles import distance
from scenicq.match.options import Tolerance

__all__ = ["ROUNDING", "agrees", "holds", "replay", "show_value"]

ROUNDING = 1e-9
"""Metres or radians that floating point may be off."""


def agrees(property_: str, value: Value, observed: Value, tolerance: Tolerance, slack: float = ROUNDING) -> bool:
    """Whether a value of a feature equals what the label observes, within the feature's tolerance.

    Args:
        property_: The feature's property.
        value: What the scenario gives.
        observed: The label's value.
        tolerance: How far they may be apart.
        slack: What is allowed beyond that.
    """
    if isinstance(value, Undefined):
        return False
    if isinstance(value, tuple) and isinstance(observed, tuple):
        dx, dy = value[0] - observed[0], value[1] - observed[1]
        if property_ != "position":
            return math.hypot(dx, dy) <= tolerance.other + slack
        if tolerance.x is not None and tolerance.y is not None:
            return abs(dx) <= tolerance.x + slack and abs(dy) <= tolerance.y + slack
        return math.hypot(dx, dy) <= tolerance.position + slack
    if isinstance(value, bool) or isinstance(observed, bool):
        return value == observed
    if isinstance(value, float) and isinstance(observed, float):
        if property_ == "heading":
            return distance(value, observed) <= tolerance.heading + slack
        return abs(value - observed) <= tolerance.other + slack
    return value == observed


def holds(constraint: Constraint, value: Value, observed: Value, tolerance: Tolerance, slack: float = ROUNDING) -> bool:
    """Whether a constraint is satisfied by the value of its expression; `observed` is a comparison's label value."""
    if isinstance(constraint, Comparison):
        return agrees(constraint.property, value, observed, tolerance, slack)
    return not isinstance(value, Undefined) and bool(value)


def show_value(property_: str, value: Value) -> str:
    """A value in a person's units."""
    if isinstance(value, Undefined):
        return value.reason
    if isinstance(value, tuple):
        return f"({value[0]:.2f}, {value[1]:.2f})"
    if isinstance(value, bool) or not isinstance(value, float):
        return str(value)
    if property_ in ("heading", "viewAngle"):
        return f"{math.degrees(value):.1f} deg"
    return f"{value:.3g}"


def replay(
    items: list[tuple[Constraint, Node, Value]],
    assignment: Mapping[Identity, Value],
    tolerance: Tolerance,
    slack: float,
) -> bool:
    """Whether a witness, evaluated plainly, satisfies every constraint within tolerance plus slack.

    Args:
        items: Constraints with what conditioning left of their expressions, and the label's values.
        assignment: Values of the random variables.
        tolerance: Per feature.
        slack: The solver's precision.
    """
    return all(
        any(_replay_one(item, assignment, tolerance, slack, turn) for turn in range(_choices(item[1], assignment)))
        for item in items
    )


MOST_CHOICES = 64


def _choices(node: Node, assignment: Mapping[Identity, Value]) -> int:
    fields = sum(isinstance(below, DirectionAt) for below in postorder((node,)))
    return min(MOST_CHOICES, 4**fields) if fields else 1


def _chooser(turn: int) -> Callable[[DirectionAt, tuple[float, ...]], float]:
    state = [turn]

    def choose(_: DirectionAt, allowed: tuple[float, ...]) -> float:
        state[0], pick = divmod(state[0], 4)
        return allowed[pick % len(allowed)]

    return choose


def _replay_one(
    item: tuple[Constraint, Node, Value],
    assignment: Mapping[Identity, Value],
    tolerance: Tolerance,
    slack: float,
    turn: int,
) -> bool:
    constraint, node, observed = item
    try:
        values = evaluate_all((node,), assignment, None, _chooser(turn))
    except CannotEvaluate:
        return False
    for below in postorder((node,)):
        if is_leaf(below):
            args = tuple(values[id(child)] for child in children(below))
            if not admits(cast(Leaf, below), args, values[id(below)], slack + ROUNDING):
                return False
    return holds(constraint, values[id(node)], observed, tolerance, slack + ROUNDING)
