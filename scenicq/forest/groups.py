"""Dependency analysis: what must be decided together (query paper, section 5.2.1; algorithm 1, line 2).

Constraints are jointly dependent if they share an unobserved random variable, transitively. The analysis cuts at
observed features: those are the label's values, not variables.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from scenicq.errors import Span
from scenicq.forest.components import connected_components
from scenicq.forest.nodes import Leaf, Node
from scenicq.forest.scenario import Requirement
from scenicq.forest.walk import features, leaves

__all__ = ["PARAMS", "Comparison", "Condition", "Constraint", "Group", "group_constraints"]

PARAMS = -1
"""The object index under which global parameters are compared."""


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """A feature that the label observes and the scenario defines: its expression must equal the label's value.

    Attributes:
        object: Index of the object, or `PARAMS`.
        property: The property.
        expression: Over random variables and observed features of other objects.
        span: Where the program defines it.
    """

    object: int
    property: str
    expression: Node
    span: Span | None


@dataclass(frozen=True, slots=True, eq=False)
class Condition:
    """A requirement that must hold."""

    requirement: Requirement
    expression: Node

    @property
    def span(self) -> Span | None:
        """Where the program states it."""
        return self.requirement.span


Constraint = Comparison | Condition


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """A maximal jointly dependent set of constraints: the unit of one decision.

    Attributes:
        constraints: In program order.
        variables: The random variables of all of them.
        objects: The objects whose features are compared or referred to, ascending.
        doubtful: Those as the program has them that read what is not observed. `constraints` say only what may hold.
        certain: All constraints, where `doubtful` ones hold only if they do whatever is not observed; empty without.
    """

    constraints: tuple[Constraint, ...]
    variables: tuple[Leaf, ...]
    objects: tuple[int, ...]
    doubtful: tuple[Constraint, ...] = ()
    certain: tuple[Constraint, ...] = ()

    @property
    def certain_group(self) -> Group:
        """The group that label objects satisfy only if they do for every value of what is not observed."""
        return replace(self, constraints=self.certain, doubtful=(), certain=()) if self.doubtful else self


def group_constraints(constraints: Iterable[Constraint]) -> tuple[Group, ...]:
    """Partition constraints into groups, in dependency order: a group comes once its last object is there."""
    items = tuple(constraints)
    parts = connected_components([[leaf.identity for leaf in leaves(item.expression)] for item in items])
    groups = [_group(tuple([items[number] for number in part])) for part in parts]
    return tuple(sorted(groups, key=lambda group: group.objects[-1] if group.objects else -1))


def _group(constraints: tuple[Constraint, ...]) -> Group:
    used: set[int] = set()
    for item in constraints:
        used.update(index for index, _ in features(item.expression))
        if isinstance(item, Comparison):
            used.add(item.object)
    found: dict[object, Leaf] = {}
    for item in constraints:
        for leaf in leaves(item.expression):
            found.setdefault(leaf.identity, leaf)
    return Group(constraints, tuple(found.values()), tuple(sorted(used - {PARAMS})))
