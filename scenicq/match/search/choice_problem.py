"""What is to be decided where constraints hold random choices: constraints, slots, and what hangs together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.components import connected_components
from scenicq.forest.nodes import (
    DiscreteRange,
    Identity,
    Index,
    Leaf,
    Node,
    Normal,
    PointIn,
    Range,
    Select,
    TruncatedNormal,
)
from scenicq.forest.walk import leaves
from scenicq.match.problem.conditioned import Item
from scenicq.match.search.outcome_tables import ChoiceTree, ChoiceVariable, Outcomes, above_choices, tree_of

__all__ = ["ChoiceProblem", "Component", "ConstraintChoices", "Domain"]


class ConstraintChoices:
    """A constraint with the choices in it.

    Attributes:
        item: The constraint.
        trees: Its outermost choices, by the ids of their nodes.
        inner: Choices in what its outermost choices lead to.
        others: The random variables, other than choices, that it depends on.
        slots: On which it hangs.
    """

    def __init__(self, item: Item) -> None:
        self.item = item
        self.trees: dict[int, ChoiceTree] = {}
        self.inner: set[ChoiceVariable] = set()
        self.others: set[ChoiceVariable] = set()
        self.slots: frozenset[int] = frozenset()
        for node, _ in above_choices(item[1]):
            if isinstance(node, Select):
                tree = self.trees[id(node)] = tree_of(node)
                self.inner |= tree.inner
                self.others |= tree.others
            elif isinstance(node, Range | Normal | TruncatedNormal | DiscreteRange | PointIn):
                self.others.add(node.identity)


@dataclass(slots=True)
class Domain:
    """A slot: what its choices may come out as.

    Attributes:
        outcomes: All that there are.
        rows: Those that are left.
        first: The number of the first outcome among the candidates of all slots.
    """

    outcomes: Outcomes
    rows: NDArray[np.intp]
    first: int


@dataclass(frozen=True, slots=True)
class Component:
    """Constraints that share random variables.

    Attributes:
        parts: The constraints.
        lookups: Expressions that say which option is taken, and must come out as what is chosen.
        slots: On which both hang.
    """

    parts: tuple[ConstraintChoices, ...]
    lookups: tuple[Node, ...]
    slots: frozenset[int]


class ChoiceProblem:
    """Constraints with their slots.

    Attributes:
        parts: The constraints.
        domains: The slots: trees of choices, one slot for all that have the same outcomes.
        slot_of: The slot of outcomes, by their ids.
        columns: The slots that a choice is part of, each with the choice's column in its table.
        components: The constraints that share random variables.
    """

    def __init__(self, parts: Sequence[ConstraintChoices]) -> None:
        """Find the slots and what hangs together."""
        self.parts = parts
        self.domains: list[Domain] = []
        self.slot_of: dict[int, int] = {}
        numbers = self.slot_of
        for part in parts:
            own: set[int] = set()
            for tree in part.trees.values():
                key = id(tree.outcomes)
                if key not in numbers:
                    numbers[key] = len(self.domains)
                    count = len(tree.outcomes.picks)
                    first = self.domains[-1].first + len(self.domains[-1].outcomes.picks) if self.domains else 0
                    self.domains.append(Domain(tree.outcomes, np.arange(count), first))
                own.add(numbers[key])
            part.slots = frozenset(own)
        self.columns: dict[ChoiceVariable, list[tuple[int, int]]] = {}
        for slot, domain in enumerate(self.domains):
            for column, variable in enumerate(domain.outcomes.variables):
                self.columns.setdefault(variable, []).append((slot, column))
        for part in parts:
            # a choice deeper in an expression comes out as it does elsewhere
            part.slots |= {slot for variable in part.inner for slot, _ in self.columns.get(variable, ())}
            part.others |= part.inner - self.columns.keys()
        self.components = self._components()

    def _components(self) -> list[Component]:
        slots = [part.slots for part in self.parts]
        others = [part.others for part in self.parts]
        lookups: list[Node] = []
        for variable, places in self.columns.items():
            if not isinstance(variable, Identity):
                used = _used(variable)
                above = [self.columns.get(leaf.identity, ()) for leaf in used if isinstance(leaf, Index)]
                lookups.append(variable)
                slots.append(frozenset(slot for each in (places, *above) for slot, _ in each))
                # a choice without a slot, such as which of several lanes is meant, is one wherever it is asked
                others.append({leaf.identity for leaf in used if leaf.identity not in self.columns})
        count = len(self.parts)
        return [
            Component(
                tuple(self.parts[number] for number in joined if number < count),
                tuple(lookups[number - count] for number in joined if number >= count),
                frozenset[int]().union(*(slots[number] for number in joined)),
            )
            for joined in connected_components(others)
        ]


@lru_cache(maxsize=1024)
def _used(variable: Node) -> tuple[Leaf, ...]:
    """The random variables of an expression that says which option is taken."""
    return leaves(variable)
