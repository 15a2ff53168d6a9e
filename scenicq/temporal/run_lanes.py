"""All runs of many stretches side by side: each stays in its situation until a sample that leads elsewhere.

Runs that are in one situation before one sample go on alike, so what becomes of them is found once. Where conditions
depend on hidden numbers, a run is split into pieces by the values of these with which it goes on alike: a piece is cut
in two at a sample whose threshold lies within it. Pieces of one start that touch and are in one situation again are
joined. Where a behavior chooses, a run is split into one for each choice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import look
from scenicq.forest.temporal import Atom
from scenicq.limits import LIMITS
from scenicq.temporal.grouping import distinct, groups, values_of
from scenicq.temporal.hidden_conditions import HiddenConditions
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.run_notes import Notes
from scenicq.temporal.run_steps import RunPositions, RunSteps
from scenicq.temporal.runs import Runs
from scenicq.temporal.stretches import Timeline
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["follow_runs"]

Places = NDArray[np.int64]
Numbers = NDArray[np.float64]
_TIMED_AT_ONCE = 32
"""Runs at once, where each has situations of its own."""


def follow_runs(
    machine: RunMachine, timeline: Timeline, atom: Callable[[Atom], Truth], hidden: HiddenConditions | None = None,
    possible: tuple[Numbers, Numbers] | None = None,
) -> Runs:  # fmt: skip
    """What becomes of the runs from all starts, in their order: one for each, or several by values of hidden numbers.

    Args:
        machine: The program.
        timeline: Samples with starts.
        atom: The value of an atom that depends on no hidden number at each place.
        hidden: The conditions that depend on some.
        possible: Between which values of each variable each run may match, shape (starts, variables); other values are
            not followed, nor runs that are lost. None where somebody reads what they fail at.
    """
    parts: list[Runs] = []
    for which in _at_once(machine, len(timeline.starts)):
        steps = RunSteps(machine, timeline, atom, which, hidden)
        # each run has a time of its own, or what becomes of all that stand alike is the same
        alike = hidden is None and not machine.timed and not machine.chooses and not steps.limited
        parts.append(_together(steps) if alike else _apart(steps, possible))
    return Runs.joined(parts)


def _at_once(machine: RunMachine, count: int) -> Iterator[NDArray[np.int64]]:
    """The numbers of runs that are followed at once, for each of which the machine is made ready."""
    # a situation that waits for a time is of one run alone
    size = _TIMED_AT_ONCE if machine.timed else max(count, 1)
    for first in range(0, count, size):
        if machine.timed:
            machine.begin()
        yield np.arange(first, min(first + size, count))


def _together(steps: RunSteps) -> Runs:
    """What became of all runs: what becomes of a run from a situation before a place is found once."""
    n = len(steps.code)
    last_at = np.repeat(steps.stretches.bounds[1:] - 1, np.diff(steps.stretches.bounds))
    numbers: dict[int, NDArray[np.int32]] = {}
    notes: list[Notes] = []
    after: list[tuple[NDArray[np.int64], Places]] = []
    count = 0

    def met(situation: int, places: Places) -> Places:
        """The places of a situation that have no number yet; they get one."""
        nonlocal count
        if situation not in numbers:
            numbers[situation] = np.full(n, -1, np.int32)
        mine = numbers[situation]
        new = distinct(places[mine[places] < 0], n)
        mine[new] = np.arange(count, count + len(new))
        count += len(new)
        return new

    waiting = {0: met(0, steps.starts)}
    while waiting:
        look()
        following: dict[int, list[Places]] = {}
        for situation, at in waiting.items():
            never = np.full(len(at), n + 1)
            none = np.empty((len(at), 0))
            last = last_at[at]
            ahead = RunPositions(np.full(len(at), situation), at, never, last, none, none)
            step = steps.step(situation, ahead, steps.exit(situation, ahead))
            notes.append(step.notes)
            after.append((step.ahead.situation, step.ahead.at))
            on = step.ahead.situation >= 0
            for number in values_of(step.ahead.situation[on]):
                following.setdefault(number, []).append(step.ahead.at[step.ahead.situation == number])
        waiting = {}
        for number, parts in following.items():
            new = met(number, np.concatenate(parts))
            if len(new):
                waiting[number] = new
    found = Notes.joined(notes)
    situations, places = (np.concatenate([each[part] for each in after]) for part in (0, 1))
    successor = np.full(count, -1)
    for number in values_of(situations[situations >= 0]):
        mine = situations == number
        successor[mine] = numbers[number][places[mine]]
    # each way is put together of two halves
    while (on := np.flatnonzero(successor >= 0)).size:
        later = successor[on]
        found.put(on, found.some(on).then(found.some(later)))
        successor[on] = successor[later]
    runs = _runs_of(steps, found.some(numbers[0][steps.starts].astype(np.int64)), np.arange(len(steps.which)))
    return replace(runs, owner=steps.which)


def _apart(steps: RunSteps, possible: tuple[Numbers, Numbers] | None) -> Runs:
    """What became of runs each of which has a time of its own, or of their pieces."""
    within = () if possible is None else (possible[0][steps.which], possible[1][steps.which])
    owner, ahead = np.arange(len(steps.which)), steps.first(*within)
    notes = Notes.nothing(len(owner))
    stops = steps.exits(ahead)
    over: list[tuple[NDArray[np.int64], Notes, RunPositions]] = []
    while len(ahead):
        look()
        # the pieces of a run go on together, so that those that stand alike again can be joined
        next_stop = np.full(len(steps.which), np.iinfo(np.int64).max)
        np.minimum.at(next_stop, owner, stops)
        place = next_stop[owner]
        ready = stops == place
        parts: list[tuple[NDArray[np.int64], Notes, RunPositions]] = []
        for situation, chosen in groups(ahead.situation[ready]):
            mine = np.flatnonzero(ready)[chosen]
            step = steps.step(situation, ahead.some(mine), stops[mine], owner[mine])
            parts.append((owner[mine][step.of], notes.some(mine[step.of]).then(step.notes), step.ahead))
        rest = np.flatnonzero(~ready)
        if len(rest):
            waiting = ahead.some(rest)
            seen = Notes.nothing(len(rest))
            for situation, mine in groups(waiting.situation):
                steps.note(seen, situation, mine, place[rest][mine])
                steps.note_first(seen, situation, mine[waiting.at[mine] == steps.starts[owner[rest][mine]]])
            waiting.at = place[rest] + 1
            parts.append((owner[rest], notes.some(rest).then(seen), waiting))
        owner = np.concatenate([each[0] for each in parts])
        notes = Notes.joined([each[1] for each in parts])
        ahead = RunPositions.joined([each[2] for each in parts])
        ended = ahead.situation < 0
        if possible is not None:
            # a run that has not ended and is lost is no match
            lost = (
                np.array([each.is_lost for each in steps.machine.situations])[ahead.situation]
                & (notes.sure < 0)
                & ~ended
            )
            notes.failed[lost] = ahead.at[lost] - 1
            ended |= lost
        over.append((owner[ended], notes.some(ended), ahead.some(ended)))
        left = owner[~ended], notes.some(~ended), ahead.some(~ended)
        owner, notes, ahead = _merged(*left, chooses=steps.machine.chooses)
        many = np.bincount(owner, minlength=len(steps.which))[owner] > LIMITS.run_pieces
        if many.any():
            open_ = notes.some(many)
            open_.undecided[:] = True
            open_.possible = np.maximum(open_.possible, ahead.at[many])
            over.append((owner[many], open_, ahead.some(many)))
            owner, notes, ahead = owner[~many], notes.some(~many), ahead.some(~many)
        stops = steps.exits(ahead)
    of = np.concatenate([each[0] for each in over])
    order = np.argsort(of, kind="stable")
    of, notes = of[order], Notes.joined([each[1] for each in over]).some(order)
    runs, ended = _runs_of(steps, notes, of), RunPositions.joined([each[2] for each in over]).some(order)
    return replace(runs, owner=steps.which[of], low=ended.low, high=ended.high)


def _runs_of(steps: RunSteps, notes: Notes, of: NDArray[np.int64]) -> Runs:
    """Notes as runs, given the number of the start of each."""
    return _closed(steps, notes, of) if steps.machine.dynamics.terminates else _open(steps, notes, of)


def _open(steps: RunSteps, notes: Notes, of: NDArray[np.int64]) -> Runs:
    """Runs of a program without an end."""
    runs = Runs.failed_at_start(steps.starts[of])
    for level, ends in ((UNKNOWN, notes.possible), (TRUE, notes.sure)):
        held = ends >= 0
        runs.truth[held], runs.ends[held] = level, ends[held]
    runs.open_[:] = (notes.sure >= 0) & (notes.possible > notes.sure)
    runs.undecided[:] = notes.undecided & (runs.truth == UNKNOWN)
    lost = runs.truth == FALSE
    runs.broken[lost] = steps.spans(notes.first_cause[lost])
    return runs


def _closed(steps: RunSteps, notes: Notes, of: NDArray[np.int64]) -> Runs:
    """Runs of a program that says when it ends."""
    last = steps.last[of]
    matches, cut = notes.sure >= 0, notes.going
    several = notes.first_match < notes.sure
    unclear = matches & (several | (notes.failed >= 0) | cut | notes.undecided) | notes.undecided
    runs = Runs.failed_at_start(steps.starts[of])
    runs.ends[:] = np.maximum(notes.sure, notes.failed)
    runs.truth[matches] = TRUE
    runs.truth[unclear] = UNKNOWN
    # where the last end itself is not seen, the first one may still be it
    early = unclear & cut & matches
    runs.ends[early] = notes.first_match[early]
    # it may end anywhere from there on
    runs.ends[unclear & notes.undecided] = last[unclear & notes.undecided]
    runs.undecided[:] = notes.undecided
    lost = runs.truth == FALSE
    runs.broken[lost] = steps.spans(notes.cause[lost])
    over = lost & cut
    runs.ends[over] = last[over]
    situations = steps.machine.situations
    lost_to = np.array([steps.cause(each.lost_to if each.is_lost else None) for each in situations], np.int64)
    runs.broken[over] = steps.spans(lost_to[notes.situation[over]])
    runs.cut_off[over] = True
    return runs


def _merged(
    owner: NDArray[np.int64], notes: Notes, ahead: RunPositions, *, chooses: bool
) -> tuple[NDArray[np.int64], Notes, RunPositions]:
    """Pieces with those joined that touch, are of one run, stand in one situation and were alike before.

    Those of a run are all before the same place.
    """
    if chooses and len(owner) > 1:
        # of lanes that stand alike one will do
        columns = (owner, ahead.situation, *ahead.low.T, *ahead.high.T, *notes.columns())
        order = np.lexsort(columns)
        new = np.zeros(len(order), np.bool_)
        new[0] = True
        for column in columns:
            new[1:] |= column[order][1:] != column[order][:-1]
        kept = np.sort(order[new])
        owner, notes, ahead = owner[kept], notes.some(kept), ahead.some(kept)
    if len(owner) < 2 or ahead.low.shape[1] != 1:
        return owner, notes, ahead
    low, high = ahead.low[:, 0], ahead.high[:, 0]
    order = np.lexsort((low, ahead.situation, owner))
    touches = np.nextafter(high[order][:-1], np.inf) == low[order][1:]
    for column in (owner, ahead.situation, *notes.columns()):
        touches &= column[order][1:] == column[order][:-1]
    if not touches.any():
        return owner, notes, ahead
    heads = np.concatenate(([True], ~touches))
    ends = np.concatenate((~touches, [True]))
    merged = ahead.some(order[heads])
    merged.high[:, 0] = high[order[ends]]
    return owner[order[heads]], notes.some(order[heads]), merged
