"""Between which values of hidden numbers a run may match: what it needs at its first sample, always and at some time.

Where nobody reads what runs fail at, other values need not be followed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.temporal import Atom
from scenicq.temporal.first_exits import next_at
from scenicq.temporal.hidden_conditions import HiddenConditions
from scenicq.temporal.required import RequiredAtoms
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.run_steps import times_out
from scenicq.temporal.stretches import Stretches
from scenicq.temporal.truth import FALSE, TRUE, Truth

__all__ = ["PossibleValues"]

Places = NDArray[np.int64]
Numbers = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PossibleValues:
    """Between which values of hidden numbers runs may match.

    Attributes:
        low, high: The ends for each start and each variable, both included, shape (starts, variables); the lower end is
            above the other one where there is none.
    """

    low: Numbers
    high: Numbers

    @property
    def any(self) -> NDArray[np.bool_]:
        """For each start whether there is one."""
        return np.logical_and.reduce(self.low <= self.high, axis=1)

    @classmethod
    def of(
        cls, machine: RunMachine, stretches: Stretches, atom: Callable[[Atom], Truth], hidden: HiddenConditions
    ) -> PossibleValues:
        """What a program leaves of them.

        Args:
            machine: The program.
            stretches: Stretches with their starts.
            atom: The value of an atom that depends on no hidden number at each place.
            hidden: The conditions that do.
        """
        m = len(stretches.starts)
        found = cls(np.tile(hidden.low, (m, 1)), np.tile(hidden.high, (m, 1)))
        required = RequiredAtoms.of(machine.dynamics)
        first, last = _ends(machine, required, stretches, atom, hidden)
        # a program that says when it ends has not ended where the samples are over
        found.high[first > stretches.ends()] = -np.inf
        first = np.minimum(first, stretches.ends())
        starts = stretches.starts
        for atoms, ends in ((required.at_start, starts), (required.always, first)):
            for each in atoms:
                found._narrow(hidden, each, starts, ends, always=True)
        for each in required.later:
            found._narrow(hidden, each, starts, last, always=False)
        return found

    def _narrow(self, hidden: HiddenConditions, atom: Atom, starts: Places, ends: Places, *, always: bool) -> None:
        """Leave out values with which a condition does not hold from each start to an end, or nowhere there."""
        possible = hidden.possible_range(atom.number) if atom.number in hidden.cuts_of else None
        if possible is None:
            return
        variable, low, high = possible
        least, most = (np.maximum, np.minimum) if always else (np.minimum, np.maximum)
        self.low[:, variable] = np.maximum(self.low[:, variable], _over(least, low, starts, ends))
        self.high[:, variable] = np.minimum(self.high[:, variable], _over(most, high, starts, ends))


def _ends(
    machine: RunMachine, required: RequiredAtoms, stretches: Stretches, atom: Callable[[Atom], Truth],
    hidden: HiddenConditions,
) -> tuple[Places, Places]:  # fmt: skip
    """The first place at which each run may end, behind the last one if there is none, and the last one."""
    starts, last = stretches.starts, stretches.ends()
    if not machine.dynamics.terminates:
        return starts, last
    due = times_out(stretches, required.within_s)
    first, latest = due, np.minimum(due, last)
    conditions = [each.condition for each in machine.dynamics.terminations if each.condition is not None]
    unclear = any(each.number in hidden.cuts_of for each in conditions) or len(required.ends) < len(conditions)
    if machine.dynamics.processes or unclear:
        first = starts
    for each in conditions:
        if each.number not in hidden.cuts_of:
            truth = atom(each)
            latest = np.minimum(latest, next_at(truth == TRUE)[starts])
            first = np.minimum(first, next_at(truth > FALSE)[starts])
    return first, latest


def _over(combine: np.ufunc, values: Numbers, starts: Places, ends: Places) -> Numbers:
    """The least or the greatest value from each start to an end, both included, by doubling."""
    lengths = ends - starts + 1
    found, table, size = values[starts], values, 1
    while True:
        mine = np.flatnonzero((lengths >= size) & (lengths < 2 * size))
        found[mine] = combine(table[starts[mine]], table[ends[mine] + 1 - size])
        if 2 * size > int(lengths.max(initial=0)):
            return found
        table = combine(table[:-size], table[size:])
        size *= 2
