"""What is decided of a label: constraints with what conditioning leaves of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from scenicq.forest.condition import Observation, condition
from scenicq.forest.groups import Comparison, Condition, Constraint, Group
from scenicq.forest.nodes import Identity, Node, Value
from scenicq.forest.scenario import Requirement

__all__ = ["Item", "condition_group", "conditioned", "fact"]

Item = tuple[Constraint, Node, Value]
"""A constraint, what conditioning left of its expression, and the label's value if it is a comparison."""


def condition_group(group: Group, observed: Observation, scope: Mapping[Identity, Value] | None = None) -> list[Item]:
    """A group's constraints given the label (algorithm 1, line 11); what they share stays shared."""
    items: list[Item] = []
    memo: dict[int, Node] = {}
    for constraint in group.constraints:
        node = condition(constraint.expression, observed, scope, memo)
        known: Value = None
        if isinstance(constraint, Comparison):
            known = observed[(constraint.object, constraint.property)]
        items.append((constraint, node, known))
    return items


def conditioned(
    items: Sequence[Item], given: Mapping[Identity, Value] | None = None, *, memo: dict[int, Node] | None = None
) -> list[Item]:
    """Items with more that is known; what they share stays shared.

    Args:
        items: The items.
        given: Values of random variables.
        memo: What stands in place of nodes, by their ids; extended by what is made.
    """
    made: dict[int, Node] = {} if memo is None else memo
    return [(constraint, condition(node, {}, given, made), seen) for constraint, node, seen in items]


def fact(holding: Node) -> Item:
    """A condition that holds in one branch of a decision, as a constraint."""
    return (Condition(Requirement(holding, holding.span), holding), holding, None)
