"""The runs of many stretches at once, where what a program says hangs on the next occurrence of something alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.temporal import Atom, Dynamics
from scenicq.temporal.occurrences import Clause, bounds, clauses_of, joined, next_at
from scenicq.temporal.runs import SLACK_S, Run, runs_from
from scenicq.temporal.stretches import Stretches
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["RunColumns", "Runs", "ends_of"]

Places = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Runs:
    """What became of runs, side by side; see `Run`.

    Attributes:
        ends: Last places, shape (m,).
        truth: Whether they match.
        broken: What keeps each from matching, as an array of `Span | None`.
        cut_off: Whether the samples are over before the program ends.
        open_: Whether a later end is not excluded.
    """

    ends: Places
    truth: Truth
    broken: NDArray[np.object_]
    cut_off: NDArray[np.bool_]
    open_: NDArray[np.bool_]

    @classmethod
    def unknown(cls, ends: Places) -> Runs:
        """Runs of which nothing is known, with their ends."""
        n = len(ends)
        return cls(ends, np.full(n, UNKNOWN), np.full(n, None, dtype=object), *np.zeros((2, n), np.bool_))

    def put(self, where: slice, found: Sequence[Run], first: int) -> None:
        """Write down what became of the runs of one stretch, which begins at place `first`."""
        for place, run in zip(range(where.start, where.stop), found, strict=True):
            self.ends[place], self.truth[place] = first + run.end, run.truth
            self.broken[place], self.cut_off[place], self.open_[place] = run.broken, run.cut_off, run.open_


@dataclass(eq=False, slots=True)
class RunColumns:
    """What a program says, made ready.

    Attributes:
        dynamics: The program.
        clauses: Of each requirement; None if one has none or there are monitors.
        together: Of all of them.
    """

    dynamics: Dynamics
    clauses: list[list[Clause]] | None = field(init=False, default=None)
    together: list[Clause] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        """Find the clauses."""
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
        if self.clauses is None:
            return self._one_by_one(stretches, atom, Runs.unknown(stretches.starts.copy()))
        if not self.dynamics.terminates:
            return self._open(stretches, atom)
        ends, over, unclear = ends_of(self.dynamics, stretches, atom)
        starts = stretches.starts
        truth = np.where(over, FALSE, TRUE)
        broken = np.full(len(starts), None, dtype=object)
        for requirement, clauses in zip(self.dynamics.requirements, self.clauses, strict=True):
            sure = _hold(clauses, atom, int(TRUE), starts, ends)
            may = _hold(clauses, atom, int(UNKNOWN), starts, ends)
            broken[~may & (truth > FALSE)] = requirement.span
            truth = np.minimum(truth, np.where(sure, TRUE, np.where(may, UNKNOWN, FALSE)))
        runs = Runs(ends, truth, broken, over, np.zeros(len(starts), np.bool_))
        return self._one_by_one(stretches, atom, runs, unclear) if unclear.any() else runs

    def _open(self, stretches: Stretches, atom: Callable[[Atom], Truth]) -> Runs:
        """Runs that may end anywhere."""
        assert self.together is not None
        assert self.clauses is not None
        starts, last = stretches.starts, stretches.ends()
        runs = Runs(
            starts.copy(),
            np.full(len(starts), FALSE),
            np.full(len(starts), None, object),
            *np.zeros((2, len(starts)), np.bool_),
        )
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

    def _one_by_one(
        self, stretches: Stretches, atom: Callable[[Atom], Truth], runs: Runs, which: NDArray[np.bool_] | None = None
    ) -> Runs:
        """The runs of those stretches decided by themselves that have one of some starts."""
        known: dict[int, Truth] = {}
        for places, mine in stretches.apart():
            if which is not None and not which[mine].any():
                continue

            def part(each: Atom, places: slice = places) -> Truth:
                if each.number not in known:
                    known[each.number] = atom(each)
                return known[each.number][places]

            starts = (stretches.starts[mine] - places.start).tolist()
            runs.put(mine, runs_from(self.dynamics, part, stretches.seconds[places], starts), places.start)
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
    if math.isfinite(after_s):
        for places, mine in stretches.apart():
            seconds, own = stretches.seconds[places], starts[mine]
            late = np.searchsorted(seconds, stretches.seconds[own] + after_s - SLACK_S) + places.start
            ends[mine] = np.minimum(ends[mine], np.maximum(late, own))
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
