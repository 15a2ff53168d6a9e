"""The runs of many stretches at once, where what a program says hangs on the next occurrence of something alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.temporal import Atom, Dynamics
from scenicq.temporal.occurrences import Clause, bounds, clauses_of, joined, next_at
from scenicq.temporal.run_lanes import follow_lanes, times_out
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.runs import Runs
from scenicq.temporal.stretches import Stretches
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["RunColumns", "ends_of"]

Places = NDArray[np.int64]


@dataclass(eq=False, slots=True)
class RunColumns:
    """What a program says, made ready.

    Attributes:
        dynamics: The program.
        clauses: Of each requirement; None if one has none or there are monitors.
        together: Of all of them.
        machine: Decides what these do not.
    """

    dynamics: Dynamics
    machine: RunMachine = field(init=False)
    clauses: list[list[Clause]] | None = field(init=False, default=None)
    together: list[Clause] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        """Find the clauses."""
        self.machine = RunMachine(self.dynamics)
        found = [clauses_of(requirement.formula) for requirement in self.dynamics.requirements]
        known = [each for each in found if each is not None]
        if len(known) == len(found) and not self.dynamics.monitors:
            self.together = joined(known)
            self.clauses = None if self.together is None else known

    def follow(self, stretches: Stretches, atom: Callable[[Atom], Truth]) -> Runs:
        """What becomes of the runs from all starts.

        Args:
            stretches: Stretches with their starts.
            atom: The value of an atom at each place.
        """
        known: dict[int, Truth] = {}

        def once(each: Atom) -> Truth:
            if each.number not in known:
                known[each.number] = atom(each)
            return known[each.number]

        every = np.arange(len(stretches.starts))
        if self.clauses is None:
            return follow_lanes(self.machine, stretches, once, every)
        runs = self._closed(stretches, once) if self.dynamics.terminates else self._open(stretches, once)
        left = every[(runs.truth == UNKNOWN) | runs.open_ | runs.cut_off]
        if len(left):
            runs.replace(left, follow_lanes(self.machine, stretches, once, left))
        return runs

    def _closed(self, stretches: Stretches, atom: Callable[[Atom], Truth]) -> Runs:
        """Runs of a program that says when it ends; unknown where the end is."""
        assert self.clauses is not None
        ends, over, unclear = ends_of(self.dynamics, stretches, atom)
        starts = stretches.starts
        truth = np.where(over, FALSE, TRUE)
        broken = np.full(len(starts), None, dtype=object)
        for requirement, clauses in zip(self.dynamics.requirements, self.clauses, strict=True):
            sure = _hold(clauses, atom, int(TRUE), starts, ends)
            may = _hold(clauses, atom, int(UNKNOWN), starts, ends)
            broken[~may & (truth > FALSE)] = requirement.span
            truth = np.minimum(truth, np.where(sure, TRUE, np.where(may, UNKNOWN, FALSE)))
        truth[unclear] = UNKNOWN
        return Runs(ends, truth, broken, over, *np.zeros((2, len(starts)), np.bool_))

    def _open(self, stretches: Stretches, atom: Callable[[Atom], Truth]) -> Runs:
        """Runs that may end anywhere."""
        assert self.together is not None
        assert self.clauses is not None
        starts, last = stretches.starts, stretches.ends()
        runs = Runs.lost(starts.copy())
        for level in (UNKNOWN, TRUE):
            best = np.full(len(starts), -1)
            for clause in self.together:
                low, high = _between(clause, atom, int(level), starts)
                high = np.minimum(high, last)
                best = np.maximum(best, np.where(np.maximum(low, starts) <= high, high, -1))
            held = best >= 0
            runs.open_[held] = runs.ends[held] > best[held]
            runs.truth[held], runs.ends[held] = level, best[held]
        lost = np.flatnonzero(runs.truth == FALSE)
        for requirement, clauses in zip(self.dynamics.requirements, self.clauses, strict=True):
            may = _hold(clauses, atom, int(UNKNOWN), starts[lost], starts[lost])
            runs.broken[lost[~may]] = requirement.span
            lost = lost[may]
        return runs


def ends_of(
    dynamics: Dynamics, stretches: Stretches, atom: Callable[[Atom], Truth]
) -> tuple[Places, NDArray[np.bool_], NDArray[np.bool_]]:
    """Where runs of a program without monitors end: at which places, whether samples are over before, whether unclear.

    Args:
        dynamics: The program; it says when it ends.
        stretches: Stretches with their starts.
        atom: The value of an atom at each place.
    """
    starts, last = stretches.starts, stretches.ends()
    ended = np.full(len(stretches.labels), FALSE)
    for termination in dynamics.terminations:
        if termination.condition is not None:
            ended = np.maximum(ended, atom(termination.condition))
    sure, possible = next_at(ended == TRUE)[starts], next_at(ended >= UNKNOWN)[starts]
    ends = np.minimum(sure, last + 1)
    after_s = min((each.after_s for each in dynamics.terminations if each.after_s is not None), default=math.inf)
    ends = np.minimum(ends, times_out(stretches, after_s))
    over = ends > last
    return np.minimum(ends, last), over, np.minimum(possible, last + 1) < np.where(over, last + 1, ends)


def _between(clause: Clause, atom: Callable[[Atom], Truth], level: int, starts: Places) -> tuple[Places, Places]:
    """Between which last places all parts of a clause hold."""
    low, high = starts, np.full(len(starts), np.iinfo(np.int64).max)
    for part in clause:
        first, last = bounds(part, atom, level, starts)
        low, high = np.maximum(low, first), np.minimum(high, last)
    return low, high


def _hold(
    clauses: Sequence[Clause], atom: Callable[[Atom], Truth], level: int, starts: Places, ends: Places
) -> NDArray[np.bool_]:
    """Whether some clause holds of runs."""
    found = np.zeros(len(starts), np.bool_)
    for clause in clauses:
        low, high = _between(clause, atom, level, starts)
        found |= (low <= ends) & (ends <= high)
    return found
