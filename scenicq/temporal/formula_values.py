"""The value of one formula over the samples of an interval: runs of a program that requires nothing else."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import Source, Span
from scenicq.forest.nodes import Node
from scenicq.forest.temporal import Atom, Dynamics, Formula, TemporalRequirement, Termination
from scenicq.temporal.run_lanes import follow_runs
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.runs import Runs
from scenicq.temporal.stretches import Timeline
from scenicq.temporal.truth import FALSE, TRUE, Truth

__all__ = ["FormulaValues"]

_LAST = -1
"""The number of the condition that holds at the last sample alone."""
_NOWHERE = Span(Source("", ""), 0, 0)


@dataclass(eq=False, slots=True)
class FormulaValues:
    """A formula made ready to be evaluated.

    Attributes:
        formula: The formula.
        conditions: What its atoms are, by number: those that are one, or each other's negation, come out together.
    """

    formula: Formula
    conditions: Sequence[Node] = ()
    _machine: RunMachine = field(init=False)

    def __post_init__(self) -> None:
        """Make the program that ends with the last sample."""
        requirement, end = TemporalRequirement(self.formula, _NOWHERE), Termination(_NOWHERE, Atom(_LAST))
        self._machine = RunMachine(Dynamics(tuple(self.conditions), (requirement,), (end,)))

    def to_the_end(self, atom: Callable[[Atom], Truth], size: int) -> Truth:
        """The value on the samples from each one to the last, shape (n,).

        Args:
            atom: The value of an atom at each sample, shape (n,).
            size: How many samples there are.
        """
        ends = np.full(size, FALSE)
        ends[-1:] = TRUE
        return self._runs(atom, ends, np.arange(size)).truth

    def may_hold(self, atom: Callable[[Atom], Truth], size: int) -> bool:
        """Whether it may hold from the first sample on if more samples come; arguments as of `to_the_end`."""
        runs = self._runs(atom, np.full(size, FALSE), np.zeros(1, np.int64))
        return runs.broken[0] is None

    def _runs(self, atom: Callable[[Atom], Truth], ends: Truth, starts: NDArray[np.int64]) -> Runs:
        timeline = Timeline(np.array([0, len(ends)]), np.zeros(len(ends)), starts)
        return follow_runs(self._machine, timeline, lambda each: ends if each.number == _LAST else atom(each))
