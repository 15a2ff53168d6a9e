"""A group over the likely values of its normal variables alone, where these are unbounded: enough for most witnesses.

A normal variable may be anything, which bounds nothing; nearly always it is within some standard deviations of its
mean, which bounds what depends on it, and which choices may come out. What matches so matches; what does not may still.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

from scenicq.forest import build
from scenicq.forest.bounds import likely_normal
from scenicq.forest.condition import condition
from scenicq.forest.groups import Comparison, Group
from scenicq.forest.interpret import interpret, steps_of
from scenicq.forest.interval_ends import FLOATS
from scenicq.forest.interval_values import can_hold
from scenicq.forest.intervals import IntervalDomain
from scenicq.forest.nodes import (
    Constant,
    Identity,
    Index,
    Node,
    Normal,
    Select,
    Value,
)
from scenicq.forest.walk import leaves, postorder
from scenicq.match.problem.outcome import Satisfied

__all__ = ["LikelyGroup", "likely_group"]

_DOMAIN = IntervalDomain(FLOATS)


@dataclass(frozen=True, slots=True)
class LikelyGroup:
    """A group over likely values.

    Attributes:
        group: The group, its normal variables truncated, its choices among the options that are then left.
        options: By the identity of such a choice, the choice that it stands for, and the number of each option there.
    """

    group: Group
    options: Mapping[Identity, tuple[Identity, tuple[int, ...]]]

    def restored(self, found: Satisfied) -> Satisfied:
        """A witness of this group as one of the group that it was made of."""
        values: dict[Identity, Value] = {}
        for identity, value in found.values.items():
            if identity in self.options and isinstance(value, float):
                original, numbers = self.options[identity]
                values[original] = float(numbers[int(value)])
            else:
                values[identity] = value
        for identity, (original, numbers) in self.options.items():
            if len(numbers) == 1 and identity not in values:
                values[original] = float(numbers[0])
        return Satisfied(values)


@lru_cache(maxsize=256)
def likely_group(group: Group) -> LikelyGroup | None:
    """The group over likely values; None if none of its variables is normal."""
    if not any(isinstance(leaf, Normal) for leaf in group.variables):
        return None
    normals: dict[int, Node] = {}
    for node in postorder([constraint.expression for constraint in group.constraints]):
        if isinstance(node, Normal):
            normals[id(node)] = likely_normal(node)
    memo = dict(normals)
    options: dict[Identity, tuple[Identity, tuple[int, ...]]] = {}
    for constraint in group.constraints:
        root = constraint.expression
        if isinstance(constraint, Comparison) or not isinstance(root, Select) or not isinstance(root.index, Index):
            continue
        found = _possible(root, normals)
        if len(found) in (0, len(root.options)):
            continue
        numbers = [build.constant(float(number)) for number in found]
        pick = Index(tuple(root.index.weights[number] for number in found), span=root.index.span)
        memo[id(root.index)] = numbers[0] if len(numbers) == 1 else Select(pick, tuple(numbers), span=root.index.span)
        options[pick.identity] = root.index.identity, tuple(found)
    constraints = tuple(
        replace(each, expression=condition(each.expression, {}, None, memo)) for each in group.constraints
    )
    variables = {leaf.identity: leaf for leaf in leaves(*(each.expression for each in constraints))}
    return LikelyGroup(Group(constraints, tuple(variables.values()), group.objects), options)


def _possible(root: Select, normals: Mapping[int, Node]) -> list[int]:
    """Which options of a condition can hold."""
    found: list[int] = []
    for number, option in enumerate(root.options):
        likely = condition(option, {}, None, dict(normals))
        if not (isinstance(likely, Constant) and likely.value is False) and can_hold(
            interpret(steps_of(likely), _DOMAIN)[id(likely)]
        ):
            found.append(number)
    return found
