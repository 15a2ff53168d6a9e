"""One step of many runs side by side: each stays in its situation until a sample that may lead elsewhere, and goes on.

A run is a lane. Where conditions depend on hidden numbers, a run has a lane for each piece of their values with which
it goes on alike; a piece is cut in two at a sample whose threshold lies within it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import Span
from scenicq.forest.temporal import Atom
from scenicq.limits import LIMITS
from scenicq.temporal.first_exits import FirstExits, next_at
from scenicq.temporal.grouping import group_equal, groups
from scenicq.temporal.hidden_conditions import HiddenConditions
from scenicq.temporal.run_machine import Advance, RunMachine
from scenicq.temporal.run_notes import Notes
from scenicq.temporal.runs import SLACK_S, later_sample
from scenicq.temporal.stretches import Timeline
from scenicq.temporal.truth import FALSE, TRUE, Truth

__all__ = ["LaneStep", "RunPositions", "RunSteps", "times_out"]

Places = NDArray[np.int64]
Numbers = NDArray[np.float64]
_MOST_COLUMNS = 64
"""Situations of which it is remembered at which places they lead elsewhere."""


@dataclass(slots=True)
class RunPositions:
    """Lanes: where they are, and how far they may go.

    Attributes:
        situation: The number of the situation of each.
        at: The next place that it reads.
        due: The place at which its time is over.
        last: The last place of its stretch.
        low, high: Between which values of hidden numbers, shape (lanes, variables).
    """

    situation: NDArray[np.int64]
    at: Places
    due: Places
    last: Places
    low: Numbers
    high: Numbers

    def __len__(self) -> int:
        """The number of lanes."""
        return len(self.at)

    def some(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> RunPositions:
        """Some of them."""
        return RunPositions(*(getattr(self, name)[which] for name in self.__slots__))

    @staticmethod
    def joined(parts: list[RunPositions]) -> RunPositions:
        """Some lanes, then others."""
        return RunPositions(
            *(np.concatenate([getattr(part, name) for part in parts]) for name in RunPositions.__slots__)
        )


@dataclass(slots=True)
class LaneStep:
    """What one step makes of lanes.

    Attributes:
        of: The lane of each.
        notes: What was seen on the way.
        ahead: Where it goes on; in no situation (-1) where it is over.
    """

    of: NDArray[np.int64]
    notes: Notes
    ahead: RunPositions


@dataclass(eq=False)
class RunSteps:
    """A program over some stretches.

    Attributes:
        machine: The program.
        stretches: The stretches.
        atom: The value of an atom that depends on no hidden number at each place.
        which: The numbers of the starts of the runs.
        hidden: The conditions that depend on hidden numbers, if there are any.
    """

    machine: RunMachine
    stretches: Timeline
    atom: Callable[[Atom], Truth]
    which: NDArray[np.int64]
    hidden: HiddenConditions | None = None
    _exits: dict[int, Places | FirstExits] = field(default_factory=dict["int", "Places | FirstExits"])
    _causes: list[Span | None] = field(default_factory=list["Span | None"])
    _cause_numbers: dict[Span, int] = field(default_factory=dict["Span", int])

    def __post_init__(self) -> None:
        """Begin, and find the places at which the same is true of what depends on no hidden number."""
        stretches, which = self.stretches, self.which
        self.starts, self.last = stretches.starts[which], stretches.ends()[which]
        limit_s = self.machine.dynamics.time_limit_s
        self.limited = limit_s is not None and math.isfinite(limit_s)
        self.due = times_out(stretches, limit_s)[which]
        self._of = {} if self.hidden is None else self.hidden.cuts_of
        known = [number for number in self.machine.atoms if number not in self._of]
        truths = [self.atom(Atom(number)) for number in known]
        code = np.zeros(len(stretches), np.int64)
        for truth in truths:
            code = _told_apart(code, truth)
        firsts, self.code = group_equal(code)
        told: list[list[int]] = [truth[firsts].tolist() for truth in truths]
        self.rows: list[dict[int, int]] = [
            {number: values[row] for number, values in zip(known, told, strict=True)} for row in range(len(firsts))
        ]

    # --- one step

    def first(self, low: Numbers | None = None, high: Numbers | None = None) -> RunPositions:
        """The lanes as they begin.

        Args:
            low: The least values of hidden numbers, shape (starts, variables); of all that they have if not given.
            high: The greatest ones.
        """
        m = len(self.which)
        if low is None or high is None:
            ends = (np.empty(0),) * 2 if self.hidden is None else (self.hidden.low, self.hidden.high)
            low, high = (np.tile(each, (m, 1)) for each in ends)
        return RunPositions(np.zeros(m, np.int64), self.starts.copy(), self.due, self.last, low, high)

    def exits(self, ahead: RunPositions) -> Places:
        """The next place of each lane that may lead elsewhere, or lies behind the end."""
        found = np.zeros(len(ahead), np.int64)
        for situation, mine in groups(ahead.situation):
            found[mine] = self.exit(situation, ahead.some(mine))
        return found

    def exit(self, number: int, ahead: RunPositions) -> Places:
        """The next place of lanes in one situation that may lead elsewhere, or lies behind the end."""
        if self.machine.timed:
            return ahead.at
        if number not in self._exits:
            if len(self._exits) >= _MOST_COLUMNS:
                self._exits.clear()
            self._exits[number] = self._leaves(number)
        leaves = self._exits[number]
        # a lane may stand behind the last place of all
        at = np.minimum(ahead.at, len(self.code) - 1)
        found = leaves.first(at, ahead.low, ahead.high) if isinstance(leaves, FirstExits) else leaves[at]
        return np.minimum(np.minimum(np.maximum(found, ahead.at), ahead.due), ahead.last + 1)

    def _leaves(self, number: int) -> Places | FirstExits:
        """For each place the first one from there that leads elsewhere."""
        reads = [each for each in self.machine.situations[number].reads if each in self._of]
        if not reads:
            stays = (Advance(number),)
            leads = [self.machine.advance(number, row, due=False) != stays for row in self.rows]
            return next_at(np.array(leads, dtype=np.bool_)[self.code])
        assert self.hidden is not None
        cuts = sorted({cut for each in reads for cut in self._of[each]})
        variables = {self.hidden.cuts[cut].variable for cut in cuts}
        if len(variables) > 1 or len(cuts) > LIMITS.jump_cuts:
            return np.arange(len(self.code))
        ends = [self.hidden.cuts[cut].at for cut in cuts]
        borders = np.sort(np.stack(ends), axis=0)
        stays_between = [
            self._stays(number, reads, {cut: end <= border for cut, end in zip(cuts, ends, strict=True)})
            for border in (np.full(len(self.code), -np.inf), *borders)
        ]
        return FirstExits.between(borders, stays_between, variables.pop())

    def _stays(self, number: int, reads: list[int], sides: dict[int, NDArray[np.bool_]]) -> NDArray[np.bool_]:
        """At which places a situation leads to itself, with the sides of hidden numbers at each."""
        told = self._told(reads, slice(None), sides)
        code = self.code
        for each in told.values():
            code = _told_apart(code, each)
        rows, which = group_equal(code)
        stays = (Advance(number),)
        held = [
            self.machine.advance(number, self._row(place, told, place), due=False) == stays
            for place in cast("list[int]", rows.tolist())
        ]
        return np.array(held, dtype=np.bool_)[which]

    def _told(
        self, reads: list[int], places: NDArray[np.int64] | slice, sides: dict[int, NDArray[np.bool_]]
    ) -> dict[int, Truth]:
        """The values of conditions on hidden numbers at places."""
        assert self.hidden is not None or not reads
        return {number: self.hidden.truth(number, places, sides) for number in reads if self.hidden is not None}

    def _row(self, place: int, told: dict[int, Truth], which: int) -> dict[int, int]:
        """The value of each atom at a place, given the values of some at several places of which it is one."""
        return self.rows[int(self.code[place])] | {number: int(each[which]) for number, each in told.items()}

    def _split(self, reads: list[int], ahead: RunPositions, there: Places) -> tuple[
        NDArray[np.int64], RunPositions, Places, dict[int, NDArray[np.bool_]]
    ]:  # fmt: skip
        """Lanes cut where they read a cut within them, with the sides that they are on."""
        of = np.arange(len(ahead))
        cuts = sorted({cut for each in reads for cut in self._of[each]})
        for cut in cuts:
            assert self.hidden is not None
            variable, at = self.hidden.cuts[cut].variable, self._cut(cut, ahead, there)
            low, high = ahead.low[:, variable], ahead.high[:, variable]
            within = np.flatnonzero((low < at) & (at <= high))
            if len(within):
                upper = ahead.some(within)
                upper.low[:, variable] = at[within]
                ahead.high[within, variable] = np.nextafter(at[within], -np.inf)
                ahead = RunPositions.joined([ahead, upper])
                of, there = np.concatenate((of, of[within])), np.concatenate((there, there[within]))
        sides = {
            cut: ahead.low[:, self.hidden.cuts[cut].variable] >= self._cut(cut, ahead, there)
            for cut in cuts if self.hidden is not None
        }  # fmt: skip
        return of, ahead, there, sides

    def _cut(self, number: int, ahead: RunPositions, there: Places) -> Numbers:
        """A cut at places; behind the last one of a lane there is none."""
        assert self.hidden is not None
        at = self.hidden.cuts[number].at
        return np.where(there > ahead.last, np.inf, at[np.minimum(there, len(at) - 1)])

    def step(self, number: int, lanes: RunPositions, there: Places, owner: NDArray[np.int64] | None = None) -> LaneStep:
        """Lanes in one situation to the next place that leads elsewhere, and beyond it.

        Args:
            number: The situation.
            lanes: The lanes.
            there: These places.
            owner: The run of each, if there are pieces.
        """
        reads = [each for each in self.machine.situations[number].reads if each in self._of]
        of, ahead, there, sides = self._split(reads, lanes.some(np.arange(len(lanes))), there)
        m = len(of)
        notes = Notes.nothing(m)
        notes.situation[:] = number
        stayed = np.flatnonzero(there > ahead.at)
        self.note(notes, number, stayed, there[stayed] - 1)
        first = np.full(m, True) if owner is None else ahead.at == self.starts[owner[of]]
        self.note_first(notes, number, stayed[first[stayed]])
        ahead.situation = np.full(m, -1)
        out = there > ahead.last
        notes.going[out] = True
        on = np.flatnonzero(~out)
        told = self._told(reads, there[on], _at(sides, on))
        kinds = there[on] if self.machine.timed else self.code[there[on]]
        for each in (*told.values(), ahead.due[on] == there[on]):
            kinds = _told_apart(kinds, each)
        ways: list[tuple[Advance, NDArray[np.int64]]] = []
        for _, chosen in groups(kinds):
            mine = on[chosen]
            here = int(there[mine[0]])
            row, due = self._row(here, told, int(chosen[0])), bool(ahead.due[mine[0]] == here)
            ways += [(each, mine) for each in self._advance(number, row, due=due, here=here)]
        if self.machine.chooses:
            # a lane for each way in which a run may choose
            ways, copied = _apart(ways, m)
            of, there, first, notes, ahead = (
                of[copied], there[copied], first[copied], notes.some(copied), ahead.some(copied),
            )  # fmt: skip
        for advance, mine in ways:
            self._ends(notes, advance, mine, there[mine])
            if advance.situation is None:
                continue
            notes.situation[mine] = advance.situation
            after = self.machine.situations[advance.situation]
            if after.undecided:
                notes.undecided[mine] = True
                notes.possible[mine] = there[mine]
                continue
            self.note(notes, advance.situation, mine, there[mine])
            self.note_first(notes, advance.situation, mine[first[mine] & (there[mine] == ahead.at[mine])])
            if after.is_lost and not self.machine.dynamics.terminates:
                continue
            ended = there[mine] == ahead.last[mine]
            notes.going[mine[ended]] = True
            ahead.situation[mine[~ended]] = advance.situation
        ahead.at = there + 1
        return LaneStep(of, notes, ahead)

    def _advance(self, number: int, row: dict[int, int], *, due: bool, here: int) -> tuple[Advance, ...]:
        if not self.machine.timed:
            return self.machine.advance(number, row, due=due)
        return self.machine.advance(number, row, due=due, here=here, later=partial(self._later, here))

    def _later(self, here: int, time_s: float) -> int:
        """The first place of a stretch so many seconds after one, and at least the next one."""
        end = int(self.stretches.bounds[np.searchsorted(self.stretches.bounds, here, side="right")])
        return here + later_sample(self.stretches.seconds[here:end], 0, time_s)

    def note(self, notes: Notes, number: int, lanes: NDArray[np.int64], places: Places) -> None:
        """Write down that runs of a program without an end may end at some places, in a situation."""
        notes.situation[lanes] = number
        truth = FALSE if self.machine.dynamics.terminates else self.machine.situations[number].truth
        if truth != FALSE:
            notes.possible[lanes] = places
        if truth == TRUE:
            notes.sure[lanes] = places

    def note_first(self, notes: Notes, number: int, lanes: NDArray[np.int64]) -> None:
        """Write down what keeps runs of a program without an end from matching in a situation at their first sample."""
        if not self.machine.dynamics.terminates:
            notes.first_cause[lanes] = self.cause(self.machine.situations[number].broken)

    def _ends(self, notes: Notes, advance: Advance, lanes: NDArray[np.int64], places: Places) -> None:
        """Write down how runs may end at some places."""
        if advance.may_match:
            notes.first_match[lanes] = places
            notes.sure[lanes] = places
        if advance.may_fail:
            notes.failed[lanes] = places
            notes.cause[lanes] = self.cause(advance.broken)

    def cause(self, span: Span | None) -> int:
        """The number of what keeps runs from matching; -1 for nothing."""
        if span is None:
            return -1
        if span not in self._cause_numbers:
            self._cause_numbers[span] = len(self._causes)
            self._causes.append(span)
        return self._cause_numbers[span]

    def spans(self, causes: NDArray[np.int64]) -> NDArray[np.object_]:
        """Causes by their numbers."""
        found = np.full(len(self._causes) + 1, None, dtype=object)
        found[: len(self._causes)] = self._causes
        return found[causes]


def _told_apart(code: NDArray[np.int64], more: Truth | NDArray[np.bool_]) -> NDArray[np.int64]:
    """Numbers that are equal where others are and a truth value is, too; they stay small."""
    if int(code.max(initial=0)) > 1 << 20:
        code = np.unique(code, return_inverse=True)[1].reshape(-1)
    return code * 3 + more


def _apart(
    ways: list[tuple[Advance, NDArray[np.int64]]], count: int
) -> tuple[list[tuple[Advance, NDArray[np.int64]]], NDArray[np.int64]]:
    """Ways to go on with lanes of their own each, and the lane that each lane is a copy of."""
    seen = np.zeros(count, np.bool_)
    copied = [np.arange(count)]
    found: list[tuple[Advance, NDArray[np.int64]]] = []
    for advance, mine in ways:
        if seen[mine].any():
            copied.append(mine)
            found.append((advance, np.arange(count, count + len(mine))))
            count += len(mine)
        else:
            seen[mine] = True
            found.append((advance, mine))
    return found, np.concatenate(copied)


def _at(sides: dict[int, NDArray[np.bool_]], which: NDArray[np.int64]) -> dict[int, NDArray[np.bool_]]:
    return {cut: each[which] for cut, each in sides.items()}


def times_out(stretches: Timeline, after_s: float | None) -> Places:
    """For each start the first place at which so many seconds are over, behind its stretch if there is none."""
    last = stretches.ends()
    if after_s is None or not math.isfinite(after_s):
        return last + 1
    # whole numbers that grow from place to place, over all stretches
    time_us = np.round(stretches.seconds * 1e6).astype(np.int64)
    whole = int(time_us.max(initial=0)) + round(min(after_s, 1e6) * 1e6) + 2
    first = np.repeat(np.arange(len(stretches.bounds) - 1), np.diff(stretches.bounds)) * whole
    wanted = (first + time_us)[stretches.starts] + round(min(after_s, 1e6) * 1e6) - round(SLACK_S * 1e6)
    return np.clip(np.searchsorted(first + time_us, wanted), stretches.starts, last + 1)
