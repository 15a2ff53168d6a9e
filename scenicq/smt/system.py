"""Systems of constraints: a formula compiled for branch and prune.

A system is a conjunction of atoms and of choices, each choice between systems. Contractors are built when a system is
first used, because most alternatives of a big disjunction are excluded by affine atoms alone. Part of the portable
solver, for worker processes only.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import cached_property

from scenicq.limits import LIMITS, exhausted
from scenicq.smt.affine import EMPTY, ENTAILED, MAYBE, AffineAtom, Forms, affine_atoms, contract_affine
from scenicq.smt.evaluation import Evaluator
from scenicq.smt.formula import Conjunction, Disjunction, Formula, Relation, TermComparison, free_variables, postorder
from scenicq.smt.hc4 import Tape

__all__ = ["Alternative", "System", "compile_system", "contract_choice"]


class System:
    """A conjunction of atoms and choices.

    Attributes:
        atoms: Constraints that must hold.
        choices: Of each, one system at least must hold.
    """

    def __init__(
        self,
        atoms: tuple[TermComparison, ...],
        choices: tuple[tuple[System, ...], ...],
        index: Mapping[str, int],
        forms: Forms,
    ) -> None:
        """Take the parts and what the systems of a problem share; nothing is built yet."""
        self.atoms = atoms
        self.choices = choices
        self._index = index
        self._forms = forms

    @cached_property
    def _contractors(self) -> tuple[list[AffineAtom], Tape | None]:
        affine: list[AffineAtom] = []
        other: list[TermComparison] = []
        for atom in self.atoms:
            found = affine_atoms(atom, self._index, self._forms)
            if found is None:
                other.append(atom)
            else:
                affine.extend(found)
        return affine, Tape(other, self._index) if other else None

    @cached_property
    def evaluator(self) -> Evaluator:
        """Margin of the atoms at a point."""
        return Evaluator(Conjunction(self.atoms))

    @cached_property
    def variables(self) -> frozenset[int]:
        """The variables of the problem that the system uses."""
        own = (self._index[name] for atom in self.atoms for name in free_variables(atom))
        inner = (number for choice in self.choices for system in choice for number in system.variables)
        return frozenset((*own, *inner))

    @cached_property
    def equalities(self) -> tuple[TermComparison, ...]:
        """The atoms that demand that two terms are equal."""
        return tuple(atom for atom in self.atoms if atom.relation is Relation.EQ)

    def contract(self, low: list[float], high: list[float]) -> int:
        """Narrow a box in place by the atoms; `EMPTY`, `MAYBE` or `ENTAILED`."""
        affine, tape = self._contractors
        verdict = ENTAILED if tape is None else MAYBE
        for atom in affine:
            said = contract_affine(atom, low, high)
            if said == EMPTY:
                return EMPTY
            verdict = min(verdict, said)
        if tape is not None and not tape.contract(low, high):
            return EMPTY
        return verdict

    def contract_all(self, low: list[float], high: list[float]) -> int:
        """Narrow a box in place by the atoms and by the hull of each choice."""
        verdict = self.contract(low, high)
        for choice in self.choices:
            if verdict == EMPTY:
                break
            said, _ = contract_choice(choice, low, high)
            verdict = min(verdict, said)
        return verdict

    def margin(self, values: Mapping[str, float]) -> float:
        """By how much atoms and choices hold at a point."""
        margin = self.evaluator(values) if self.atoms else math.inf
        for choice in self.choices:
            if margin == -math.inf:
                break
            margin = min(margin, max((system.margin(values) for system in choice), default=-math.inf))
        return margin


Alternative = tuple[System, list[float], list[float]]
"""A system of a choice with the box that it leaves."""


def contract_choice(choice: Iterable[System], low: list[float], high: list[float]) -> tuple[int, list[Alternative]]:
    """Narrow a box in place to the hull of what the systems of a choice leave, and list those that leave something."""
    live: list[Alternative] = []
    for system in choice:
        lower, upper = low[:], high[:]
        said = system.contract_all(lower, upper)
        if said == ENTAILED:
            return ENTAILED, []
        if said == MAYBE:
            live.append((system, lower, upper))
    if not live:
        return EMPTY, []
    low[:] = map(min, *(lower for _, lower, _ in live)) if len(live) > 1 else live[0][1]
    high[:] = map(max, *(upper for _, _, upper in live)) if len(live) > 1 else live[0][2]
    return MAYBE, live


def compile_system(constraint: Formula, index: Mapping[str, int]) -> System:
    """Compile a formula.

    Args:
        constraint: The formula.
        index: The number of each variable.

    Raises:
        Exhausted: Choices are nested deeper than `LIMITS.formula_nesting`.
    """
    forms: Forms = {}
    systems: dict[int, System] = {}
    nesting: dict[int, int] = {}
    order = postorder(constraint, terms=False)
    for node in order:
        match node:
            case TermComparison():
                systems[id(node)] = System((node,), (), index, forms)
                nesting[id(node)] = 0
            case Conjunction(args):
                parts = [systems[id(arg)] for arg in args]
                atoms = tuple(atom for part in parts for atom in part.atoms)
                choices = tuple(choice for part in parts for choice in part.choices)
                systems[id(node)] = System(atoms, choices, index, forms)
                nesting[id(node)] = max((nesting[id(arg)] for arg in args), default=0)
            case Disjunction(args):
                systems[id(node)] = System((), (tuple(systems[id(arg)] for arg in args),), index, forms)
                nesting[id(node)] = 1 + max((nesting[id(arg)] for arg in args), default=0)
            case _:
                continue
        if nesting[id(node)] > LIMITS.formula_nesting:
            raise exhausted("formula_nesting")
    return systems[id(constraint)]
