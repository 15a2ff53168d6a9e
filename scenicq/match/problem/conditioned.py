"""What is decided of a label: constraints with what conditioning leaves of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

from scenicq.forest.condition import Observation, condition
from scenicq.forest.groups import Comparison, Condition, Constraint, Group
from scenicq.forest.nodes import Feature, Identity, Node, Value
from scenicq.forest.scenario import Requirement
from scenicq.forest.walk import children, postorder

__all__ = ["Item", "condition_group", "conditioned", "fact"]

Item = tuple[Constraint, Node, Value]
"""A constraint, what conditioning left of its expression, and the label's value if it is a comparison."""


def condition_group(group: Group, observed: Observation, scope: Mapping[Identity, Value] | None = None) -> list[Item]:
    """A group's constraints given the label (algorithm 1, line 11); what they share stays shared."""
    items: list[Item] = []
    memo = {} if scope else dict(_unobserved(group))
    for constraint in group.constraints:
        node = condition(constraint.expression, observed, scope, memo)
        known: Value = None
        if isinstance(constraint, Comparison):
            known = observed[(constraint.object, constraint.property)]
        items.append((constraint, node, known))
    return items


@lru_cache(maxsize=256)
def _unobserved(group: Group) -> Mapping[int, Node]:
    """The largest parts of a group's expressions that no label changes, by their ids: choices among map elements."""
    roots = [constraint.expression for constraint in group.constraints]
    observing: set[int] = set()
    largest: dict[int, Node] = {}
    for node in postorder(roots):
        below = children(node)
        if isinstance(node, Feature) or any(id(child) in observing for child in below):
            observing.add(id(node))
            largest.update((id(child), child) for child in below if children(child) and id(child) not in observing)
    largest.update((id(root), root) for root in roots if id(root) not in observing)
    memo: dict[int, Node] = {}
    return {key: condition(node, {}, None, memo) for key, node in largest.items()}


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
