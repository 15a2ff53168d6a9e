"""All runs of many stretches side by side: each stays in its situation until a sample that leads elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.temporal import Atom
from scenicq.temporal.occurrences import next_at
from scenicq.temporal.run_machine import Advance, RunMachine
from scenicq.temporal.runs import SLACK_S, Runs
from scenicq.temporal.stretches import Stretches
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["follow_lanes", "times_out"]

Places = NDArray[np.int64]
_TIMED_AT_ONCE = 32
"""Runs at once, where each has situations of its own."""
_MOST_COLUMNS = 64
"""Situations of which it is remembered at which places they lead elsewhere."""


def follow_lanes(
    machine: RunMachine, stretches: Stretches, atom: Callable[[Atom], Truth], which: NDArray[np.int64]
) -> Runs:
    """What becomes of the runs from some starts.

    Args:
        machine: The program.
        stretches: Stretches with their starts.
        atom: The value of an atom at each place.
        which: The numbers of these starts.
    """
    runs = Runs.unknown(stretches.starts[which].copy())
    # a situation that waits for a time is of one run alone
    size = _TIMED_AT_ONCE if machine.timed else max(len(which), 1)
    for first in range(0, len(which), size):
        if machine.timed:
            machine.begin()
        lanes = _Lanes(machine, stretches, atom, which[first : first + size])
        lanes.run()
        found = lanes.closed() if machine.dynamics.terminates else lanes.open()
        runs.replace(np.arange(first, min(first + size, len(which))), found)
    return runs


def times_out(stretches: Stretches, after_s: float) -> Places:
    """For each start the first place at which so many seconds are over, the end of its stretch if there is none."""
    found = stretches.ends() + 1
    if math.isfinite(after_s):
        for places, mine in stretches.apart():
            seconds, own = stretches.seconds[places], stretches.starts[mine]
            late = np.searchsorted(seconds, stretches.seconds[own] + after_s - SLACK_S) + places.start
            found[mine] = np.maximum(late, own)
    return found


@dataclass(eq=False)
class _Lanes:
    """One lane for each run; its place is the next one that it reads."""

    machine: RunMachine
    stretches: Stretches
    atom: Callable[[Atom], Truth]
    which: NDArray[np.int64]
    _columns: dict[int, Places] = field(default_factory=dict["int", Places])

    def __post_init__(self) -> None:
        """Begin, and find the places at which the same is true."""
        stretches, which = self.stretches, self.which
        n, m = len(stretches.labels), len(which)
        self.starts, self.last = stretches.starts[which], stretches.ends()[which]
        after_s = min(
            (e.after_s for e in self.machine.dynamics.terminations if e.after_s is not None), default=math.inf
        )
        self.due = times_out(stretches, after_s)[which]
        self.code = np.zeros(n, np.int64)
        for number in self.machine.atoms:
            values = self.atom(Atom(number))
            if int(self.code.max(initial=0)) > 1 << 58:
                self.code = np.unique(self.code, return_inverse=True)[1]
            self.code = self.code * 3 + values
        _, firsts, which_row = np.unique(self.code, return_index=True, return_inverse=True)
        self.code = which_row.reshape(-1).astype(np.int64)
        told: list[list[int]] = [self.atom(Atom(number))[firsts].tolist() for number in self.machine.atoms]
        self.rows: list[dict[int, int]] = [
            {number: values[row] for number, values in zip(self.machine.atoms, told, strict=True)}
            for row in range(len(firsts))
        ]
        # places by what is known to be so there; -1 where nothing is
        self.sure, self.possible, self.failed = (np.full(m, -1) for _ in range(3))
        self.first_match = np.full(m, n)
        self.situation = np.zeros(m, np.int64)
        self.going = np.zeros(m, np.bool_)
        self.undecided = np.zeros(m, np.bool_)
        self.broken = np.full(m, None, dtype=object)
        self.at_first = np.full(m, None, dtype=object)

    def run(self) -> None:
        """Follow all lanes to their ends."""
        lanes, at = np.arange(len(self.which)), self.starts.copy()
        while len(lanes):
            of = self.situation[lanes]
            following: list[tuple[NDArray[np.int64], Places]] = []
            for number in np.unique(of).tolist():
                mine = of == number
                following += self._onwards(number, lanes[mine], at[mine])
            lanes = np.concatenate([each for each, _ in following]) if following else lanes[:0]
            at = np.concatenate([each for _, each in following]) if following else at[:0]

    def _onwards(self, number: int, lanes: NDArray[np.int64], at: Places) -> list[tuple[NDArray[np.int64], Places]]:
        """Lanes in one situation to the next place that leads elsewhere, and beyond it."""
        there = np.minimum(np.minimum(self._leaves(number)[at], self.due[lanes]), self.last[lanes] + 1)
        self._note(number, lanes[there > at], there[there > at] - 1)
        self.at_first[lanes[(there > at) & (at == self.starts[lanes])]] = self.machine.situations[number].broken
        out = there > self.last[lanes]
        self.going[lanes[out]] = True
        lanes, there = lanes[~out], there[~out]
        kinds = (there if self.machine.timed else self.code[there]) * 2 + (self.due[lanes] == there)
        following: list[tuple[NDArray[np.int64], Places]] = []
        for kind in cast("list[int]", np.unique(kinds).tolist()):
            some = kinds == kind
            row, due = divmod(kind, 2)
            if self.machine.timed:
                here = row
                row, later = int(self.code[here]), partial(self._later, here)
                advance = self.machine.advance(number, self.rows[row], due=bool(due), here=here, later=later)
            else:
                advance = self.machine.advance(number, self.rows[row], due=bool(due))
            own, place = lanes[some], there[some]
            self._ends(advance, own, place)
            if advance.situation is None:
                continue
            self.situation[own] = advance.situation
            after = self.machine.situations[advance.situation]
            if after.undecided:
                self.undecided[own] = True
                self.possible[own] = place
                continue
            self._note(advance.situation, own, place)
            self.at_first[own[place == self.starts[own]]] = after.broken
            if after.is_lost and not self.machine.dynamics.terminates:
                continue
            over = place == self.last[own]
            self.going[own[over]] = True
            following.append((own[~over], place[~over] + 1))
        return following

    def _leaves(self, number: int) -> Places:
        """For each place the first one from there that leads elsewhere."""
        if self.machine.timed:
            return np.arange(len(self.code))
        if number not in self._columns:
            if len(self._columns) >= _MOST_COLUMNS:
                self._columns.clear()
            stays = Advance(number)
            leads = [self.machine.advance(number, row, due=False) != stays for row in self.rows]
            self._columns[number] = next_at(np.array(leads, dtype=np.bool_)[self.code])
        return self._columns[number]

    def _later(self, here: int, time_s: float) -> int:
        """The first place of a stretch so many seconds after one, and at least the next one."""
        end = int(self.stretches.bounds[np.searchsorted(self.stretches.bounds, here, side="right")])
        seconds = self.stretches.seconds
        found = here + int(np.searchsorted(seconds[here:end], float(seconds[here]) + time_s - SLACK_S))
        return max(found, here + 1)

    def _note(self, number: int, lanes: NDArray[np.int64], places: Places) -> None:
        """Write down that runs of a program without an end may end at some places, in a situation."""
        truth = FALSE if self.machine.dynamics.terminates else self.machine.situations[number].truth
        if truth != FALSE:
            self.possible[lanes] = places
        if truth == TRUE:
            self.sure[lanes] = places

    def _ends(self, advance: Advance, lanes: NDArray[np.int64], places: Places) -> None:
        """Write down how runs may end at some places."""
        if advance.may_match:
            self.first_match[lanes] = np.minimum(self.first_match[lanes], places)
            self.sure[lanes] = places
        if advance.may_fail:
            self.failed[lanes] = places
            self.broken[lanes] = advance.broken

    def open(self) -> Runs:
        """Runs of a program without an end."""
        runs = Runs.lost(self.starts.copy())
        for level, ends in ((UNKNOWN, self.possible), (TRUE, self.sure)):
            held = ends >= 0
            runs.truth[held], runs.ends[held] = level, ends[held]
        runs.open_[:] = (self.sure >= 0) & (self.possible > self.sure)
        runs.undecided[:] = self.undecided & (runs.truth == UNKNOWN)
        lost = runs.truth == FALSE
        runs.broken[lost] = self.at_first[lost]
        return runs

    def closed(self) -> Runs:
        """Runs of a program that says when it ends."""
        matches, cut = self.sure >= 0, self.going
        several = self.first_match < self.sure
        unclear = matches & (several | (self.failed >= 0) | cut | self.undecided) | self.undecided
        runs = Runs.lost(np.maximum(self.sure, self.failed))
        runs.truth[matches] = TRUE
        runs.truth[unclear] = UNKNOWN
        # where the last end itself is not seen, the first one may still be it
        early = unclear & cut & matches
        runs.ends[early] = self.first_match[early]
        # it may end anywhere from there on
        runs.ends[unclear & self.undecided] = self.last[unclear & self.undecided]
        runs.undecided[:] = self.undecided
        lost = runs.truth == FALSE
        runs.broken[lost] = self.broken[lost]
        over = lost & cut
        runs.ends[over] = self.last[over]
        for lane in np.flatnonzero(over).tolist():
            situation = self.machine.situations[int(self.situation[lane])]
            runs.broken[lane] = situation.lost_to if situation.is_lost else None
        runs.cut_off[over] = True
        return runs
