"""What is decided of a label: constraints with what conditioning leaves of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import cast

from scenicq.forest import build
from scenicq.forest.condition import Observation, condition
from scenicq.forest.groups import PARAMS, Comparison, Condition, Constraint, Group
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import (
    Among,
    Compare,
    CompareOp,
    Constant,
    DirectionAt,
    DiscreteRange,
    Feature,
    Identity,
    Index,
    Leaf,
    Logic,
    LogicOp,
    Node,
    Select,
    Value,
)
from scenicq.forest.scenario import Requirement
from scenicq.forest.walk import children, postorder

__all__ = [
    "Item",
    "LabelNodes",
    "condition_group",
    "condition_items",
    "fact",
    "item_conjuncts",
    "options_of",
    "uses_far_field",
    "uses_field",
]

Item = tuple[Constraint, Node, Value]
"""A constraint, what conditioning left of its expression, and the label's value if it is a comparison."""


def uses_field(items: Iterable[Item]) -> bool:
    """Whether constraints ask a vector field at a point that conditioning left unknown."""
    return any(isinstance(node, DirectionAt) for node in postorder([node for _, node, _ in items]))


def uses_far_field(items: Sequence[Item]) -> int:
    """How often they ask a vector field at a point that no label observes, so that much of the map may count."""
    seen = {id(node) for constraint, node, _ in items if getattr(constraint, "property", "") == "position"}
    fields = [node for node in postorder([node for _, node, _ in items]) if isinstance(node, DirectionAt)]
    return sum(not isinstance(node.point, Constant) and id(node.point) not in seen for node in fields)


@dataclass(eq=False, slots=True)
class LabelNodes:
    """What conditioning made of nodes for one label, by the label objects that they read: in all groups the same."""

    _made: dict[tuple[Node, tuple[int, ...]], Node] = field(default_factory=dict["tuple[Node, tuple[int, ...]]", Node])

    def items(self, group: Group, observed: Observation, assignment: Mapping[int, int]) -> list[Item]:
        """A group's constraints, see `condition_group`, for the label objects in its roles."""
        keys = [(node, tuple([assignment[index] for index in roles])) for node, roles in _readers(group)]
        memo = {id(key[0]): self._made[key] for key in keys if key in self._made}
        items = condition_group(group, observed, memo)
        self._made.update((key, memo[id(key[0])]) for key in keys if id(key[0]) in memo)
        return items


def condition_group(group: Group, observed: Observation, made: dict[int, Node] | None = None) -> list[Item]:
    """A group's constraints given the label (algorithm 1, line 11); what they share stays shared.

    Args:
        group: The group.
        observed: What the label observes of the objects.
        made: What was made of nodes before, by their ids; extended.
    """
    items: list[Item] = []
    memo: dict[int, Node] = {} if made is None else made
    memo |= _unobserved(group)
    for constraint in group.constraints:
        node = condition(constraint.expression, observed, None, memo)
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
        if isinstance(node, Feature | Among) or any(id(child) in observing for child in below):
            observing.add(id(node))
            largest.update((id(child), child) for child in below if children(child) and id(child) not in observing)
    largest.update((id(root), root) for root in roots if id(root) not in observing)
    memo: dict[int, Node] = {}
    return {key: condition(node, {}, None, memo) for key, node in largest.items()}


@lru_cache(maxsize=256)
def _readers(group: Group) -> tuple[tuple[Node, tuple[int, ...]], ...]:
    """Nodes with the objects that they read, ascending; of groups without fields, which are decided at once, none."""
    nodes = list(postorder([constraint.expression for constraint in group.constraints]))
    changed = any(id(made) != key for key, made in _unobserved(group).items())
    if changed or not any(isinstance(node, DirectionAt) for node in nodes):
        return ()
    read: dict[int, frozenset[int]] = {}
    for node in nodes:
        own = {node.object} - {PARAMS} if isinstance(node, Feature) else ()
        read[id(node)] = frozenset(own).union(*[read[id(child)] for child in children(node)])
    return tuple((node, tuple(sorted(read[id(node)]))) for node in nodes if read[id(node)])


def condition_items(
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


def item_conjuncts(item: Item) -> list[Item]:
    """A constraint as several that all hold; of alternatives, which one holds is a choice.

    That two truth values are equal, or not, is an alternative, too: which values they have.
    """
    constraint, root, seen = item
    if isinstance(constraint, Comparison):
        return [item]
    found: list[Item] = []
    todo: list[tuple[Node, bool]] = [(root, True)]
    while todo:
        node, wanted = todo.pop()
        if isinstance(node, Compare) and kind_of(node.left) == kind_of(node.right) == "boolean":
            other = node.right if (node.op is CompareOp.EQ) is wanted else build.opposite(node.right)
            both = build.logic(LogicOp.AND, node.left, other)
            neither = build.logic(LogicOp.AND, build.opposite(node.left), build.opposite(other))
            todo.append((build.logic(LogicOp.OR, both, neither, span=node.span), True))
        elif not isinstance(node, Logic):
            holding = node if wanted else build.opposite(node)
            found.append((constraint, holding, seen))
        elif node.op is LogicOp.NOT:
            todo.append((node.args[0], not wanted))
        elif (node.op is LogicOp.AND) is wanted:
            todo += [(arg, wanted) for arg in reversed(node.args)]
        else:
            args = tuple(arg if wanted else build.opposite(arg) for arg in node.args)
            index = Index((1.0,) * len(args), span=node.span)
            found.append((constraint, Select(index, args, span=node.span), seen))
    return found


def options_of(leaf: Leaf) -> range | None:
    """The values of a discrete variable; None if it is none, or they are not known."""
    match leaf:
        case Index():
            return range(len(leaf.weights))
        case DiscreteRange(low=Constant(value=low), high=Constant(value=high)):
            return range(math.ceil(cast(float, low)), math.floor(cast(float, high)) + 1)
        case _:
            return None
