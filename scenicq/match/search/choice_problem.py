"""What is to be decided where constraints hold random choices: constraints, slots, and what hangs together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenicq.forest import build
from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import (
    DiscreteRange,
    Identity,
    Index,
    Logic,
    LogicOp,
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

__all__ = ["ChoiceProblem", "Component", "ConstraintChoices", "Domain", "Lookup", "conjuncts"]


def conjuncts(item: Item) -> list[Item]:
    """A constraint as several that all hold; of alternatives, which one holds is a choice."""
    constraint, root, seen = item
    if isinstance(constraint, Comparison):
        return [item]
    found: list[Item] = []
    todo: list[tuple[Node, bool]] = [(root, True)]
    while todo:
        node, wanted = todo.pop()
        if not isinstance(node, Logic):
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


@dataclass(slots=True)
class Lookup:
    """A choice that an expression makes: what its point has to satisfy."""

    variable: Node


@dataclass(slots=True)
class Component:
    """Constraints that share random variables, and the slots on which they hang."""

    parts: list[ConstraintChoices] = field(default_factory=list[ConstraintChoices])
    lookups: list[Lookup] = field(default_factory=list[Lookup])
    slots: set[int] = field(default_factory=set[int])
    others: set[ChoiceVariable] = field(default_factory=set["ChoiceVariable"])


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
        found: list[Component] = []
        pieces: list[Component] = [Component([part], [], set(part.slots), set(part.others)) for part in self.parts]
        for variable, places in self.columns.items():
            if not isinstance(variable, Identity):
                used = leaves(variable)
                below: set[ChoiceVariable] = {leaf.identity for leaf in used if not isinstance(leaf, Index)}
                above = [self.columns.get(leaf.identity, ()) for leaf in used if isinstance(leaf, Index)]
                slots = {slot for each in (places, *above) for slot, _ in each}
                pieces.append(Component([], [Lookup(variable)], slots, below))
        for piece in pieces:
            for other in [each for each in found if each.others & piece.others]:
                found.remove(other)
                piece.parts[:0] = other.parts
                piece.lookups[:0] = other.lookups
                piece.slots |= other.slots
                piece.others |= other.others
            found.append(piece)
        return found
