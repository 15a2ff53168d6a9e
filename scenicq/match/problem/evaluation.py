"""Comparing known values: the exact first step of the cascade, and the replay of witnesses."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import cast

from scenicq.errors import CannotEvaluate
from scenicq.forest.components import connected_components
from scenicq.forest.evaluate import admits, evaluate_all
from scenicq.forest.groups import Comparison, Constraint
from scenicq.forest.nodes import Constant, DirectionAt, Identity, Index, Leaf, Node, Undefined, Value
from scenicq.forest.walk import children, is_leaf, leaves, postorder
from scenicq.geometry.angles import distance
from scenicq.limits import LIMITS
from scenicq.match.problem.conditioned import Item, condition_items
from scenicq.match.tolerance import ROUNDING, Tolerance

__all__ = ["ground_cause", "holds", "replay", "show_value", "unlike"]


def holds(constraint: Constraint, value: Value, observed: Value, tolerance: Tolerance, slack: float = ROUNDING) -> bool:
    """Whether a constraint is satisfied by the value of its expression; `observed` is a comparison's label value."""
    if isinstance(constraint, Comparison):
        return tolerance.of(constraint.object, constraint.property).allows(value, observed, slack)
    return not isinstance(value, Undefined) and bool(value)


def show_value(property_: str, value: Value) -> str:
    """A value in a person's units."""
    if isinstance(value, Undefined):
        return value.reason
    if isinstance(value, tuple):
        return f"({value[0]:z.2f}, {value[1]:z.2f})"
    if isinstance(value, bool) or not isinstance(value, float):
        return str(value)
    if property_ in ("heading", "viewAngle"):
        return f"{math.degrees(value):z.1f} deg"
    return f"{value:z.3g}"


def unlike(property_: str, value: Value, observed: Value) -> str:
    """Say that a label's value is not the one that the scenario gives, in units that people read."""
    return f"is {show_value(property_, observed)}, not {show_value(property_, value)}"


def replay(
    items: list[tuple[Constraint, Node, Value]],
    assignment: Mapping[Identity, Value],
    tolerance: Tolerance,
    slack: float,
    headings: Mapping[int, float] | None = None,
) -> bool:
    """Whether a witness, evaluated plainly, satisfies every constraint within tolerance plus slack.

    Where a field allows several directions, one use of it has one of them in all constraints that refer to it.

    Args:
        items: Constraints with what conditioning left of their expressions, and the label's values.
        assignment: Values of the random variables.
        tolerance: Per feature.
        slack: The solver's precision.
        headings: The direction of some uses of fields, by the node's id; if given, the nearest allowed one is taken.
    """
    asked = leaves(*(node for _, node, _ in items))
    if any(leaf.identity not in assignment for leaf in asked):
        # what is not picked needs no value
        picked = [leaf.identity for leaf in asked if isinstance(leaf, Index) and leaf.identity in assignment]
        items = condition_items(items, {identity: assignment[identity] for identity in picked})
    if headings is not None:

        def nearest(node: DirectionAt, allowed: tuple[float, ...]) -> float:
            wanted = headings.get(id(node), allowed[0])
            return min(allowed, key=lambda heading: distance(heading, wanted))

        return _holds_with(items, assignment, tolerance, slack, nearest)
    for part in _sharing(items):
        picks = _Picks()
        while not _holds_with(part, assignment, tolerance, slack, picks):
            if not picks.advance():
                return False
    return True


_Items = list[tuple[Constraint, Node, Value]]


def _sharing(items: _Items) -> list[_Items]:
    """The items in parts that have no use of a field in common: one use is one direction, whoever refers to it."""
    uses = [[id(below) for below in postorder((node,)) if isinstance(below, DirectionAt)] for _, node, _ in items]
    return [[items[number] for number in part] for part in connected_components(uses)]


class _Picks:
    """Picks directions, another combination after each `advance`; the last use of a field changes first."""

    def __init__(self) -> None:
        self.picked: list[int] = []
        self.sizes: list[int] = []
        self.left = LIMITS.replayed_directions

    def __call__(self, _: DirectionAt, allowed: tuple[float, ...]) -> float:
        if len(self.sizes) == len(self.picked):
            self.picked.append(0)
        self.sizes.append(len(allowed))
        return allowed[self.picked[len(self.sizes) - 1]]

    def advance(self) -> bool:
        """Go to the next combination, if there is one and it is not one too many."""
        self.left -= 1
        while self.sizes and self.picked[-1] + 1 == self.sizes[-1]:
            self.picked.pop()
            self.sizes.pop()
        if not self.sizes or self.left <= 0:
            return False
        self.picked[-1] += 1
        self.sizes = []
        return True


def _holds_with(
    items: _Items,
    assignment: Mapping[Identity, Value],
    tolerance: Tolerance,
    slack: float,
    choose: Callable[[DirectionAt, tuple[float, ...]], float],
) -> bool:
    roots = tuple(node for _, node, _ in items)
    try:
        values = evaluate_all(roots, assignment, None, choose)
    except CannotEvaluate:
        return False
    for below in postorder(roots):
        if is_leaf(below):
            args = tuple(values[id(child)] for child in children(below))
            if not admits(cast(Leaf, below), args, values[id(below)], slack + ROUNDING):
                return False
    return all(
        holds(constraint, values[id(node)], seen, tolerance, slack + ROUNDING) for constraint, node, seen in items
    )


def ground_cause(item: Item) -> str:
    """What a ground constraint that fails looks like, for a person."""
    constraint, node, observed = item
    value = cast(Constant, node).value
    if isinstance(constraint, Comparison):
        return unlike(constraint.property, value, observed)
    return value.reason if isinstance(value, Undefined) else "does not hold"
