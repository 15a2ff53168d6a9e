"""The intervals of recordings that match: bindings and start samples in, intervals out (see `IntervalMatcher`).

A binding gives each object of the scenario a track, for the whole interval. A start is a sample whose label matches
the initial scene under a binding. All runs of a block are followed side by side, on columns over the samples in which
all tracks of a binding live (`stretches`); where conditions depend on random variables of the scene, by the values of
these for which they hold (`hidden_runs`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import Exhausted, look
from scenicq.errors import Span
from scenicq.forest.among import properties_of_others
from scenicq.forest.condition import expand
from scenicq.forest.nodes import Node
from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import features
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import WitnessValue
from scenicq.smt.answer import Solver
from scenicq.store.track_block import TrackReach
from scenicq.store.tracks import TrackKey
from scenicq.temporal.arrivals import Arrivals, LabelOf
from scenicq.temporal.atoms import AtomColumns, reads_start
from scenicq.temporal.hidden import random_variables
from scenicq.temporal.hidden_examples import InitialScene
from scenicq.temporal.hidden_runs import HiddenRuns, StartLabel
from scenicq.temporal.interval_options import IntervalOptions
from scenicq.temporal.outcomes import Outcome, outcomes_of, steady_value
from scenicq.temporal.presence import group_by_observed
from scenicq.temporal.run_lanes import follow_runs
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.runs import Detail, Runs
from scenicq.temporal.samples import is_moving
from scenicq.temporal.selection import choose_intervals
from scenicq.temporal.stretches import StartTable, Stretches, stretches_of
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["BindingOutcome", "IntervalMatcher", "IntervalVerdict"]


@dataclass(frozen=True, slots=True)
class IntervalVerdict:
    """What became of a binding in an interval of a recording.

    Attributes:
        start, end: First and last sample.
        truth: Whether it matches.
        binding: The track of each object, by index.
        recording: The number of the recording in its block.
        origin: The number of the start in its table.
        witness: Values of random variables of conditions over time that prove a match, by their place in the program.
        reason: Why it is unknown; empty where it is so because its start is.
        broken: What keeps it from matching, in the program.
        cut_off: Whether the recording or a track ends before the program does; `broken` says what is lost by then.
    """

    start: int
    end: int
    truth: int
    binding: tuple[tuple[int, TrackKey], ...]
    recording: int = 0
    origin: int = -1
    witness: Mapping[str, WitnessValue] = field(default_factory=dict["str", "WitnessValue"])
    reason: str = ""
    broken: Span | None = None
    cut_off: bool = False


@dataclass(frozen=True, slots=True)
class BindingOutcome:
    """What became of the bindings of a block.

    Attributes:
        intervals: The intervals that match or may, by recording, then in order of time; of a binding without one how
            far it came, if that is wanted.
        bindings: How many bindings there are.
        others: How many of them have no interval and are not told of, by what keeps each from matching and whether it
            is cut off.
    """

    intervals: list[IntervalVerdict]
    bindings: int = 0
    others: Counter[tuple[Span | None, bool]] = field(default_factory=Counter["tuple[Span | None, bool]"])


@dataclass(eq=False, slots=True)
class _Program:
    """What the program says about time with one outcome of its choices, made ready.

    Attributes:
        initial: What the labels of starts are matched with.
        machine: What it says; None where it says nothing.
        apart: Whether what is read at the start of a run is another value for each.
    """

    initial: InitialScene
    machine: RunMachine | None = field(init=False)
    apart: bool = field(init=False)

    @property
    def scenario(self) -> Scenario:
        """The scenario with this outcome."""
        return self.initial.scenario

    def __post_init__(self) -> None:
        """Make ready."""
        scenario, dynamics = self.scenario, self.scenario.dynamics
        self.machine = None if dynamics is None else RunMachine(dynamics)
        conditions = () if dynamics is None else dynamics.conditions
        self.apart = any(reads_start(expand(each, lambda f: steady_value(scenario, f))) for each in conditions)


@dataclass(eq=False)
class IntervalMatcher:
    """A scenario made ready to be matched against recordings of one map.

    Attributes:
        scenario: The scenario, made ready to be matched.
        match: Options of the matcher, for initial scenes.
        options: The options of intervals.
        solver: Decides what is not decided otherwise.
        reasons: Whether somebody reads what bindings fail at.
        outcomes: The outcomes of the choices that conditions over time depend on.
    """

    scenario: Scenario
    match: MatchOptions
    options: IntervalOptions
    solver: Solver | None = None
    reasons: bool = True
    outcomes: tuple[Outcome, ...] = field(init=False)

    def __post_init__(self) -> None:
        """Split off the choices."""
        self.outcomes = outcomes_of(self.scenario)
        self._label: LabelOf | None = None
        self._arrivals = Arrivals(self.scenario, self.match, self.solver) if self.scenario.arrivals else None

    @property
    def reach(self) -> TrackReach | None:
        """How much of the tracks of starts matters; None for all that follows."""
        dynamics = self.scenario.dynamics
        if properties_of_others(self.scenario) is not None or self.scenario.arrivals:
            return None
        if dynamics is None:
            return TrackReach(0.0, self.options.gap_s, gaps=True)
        limit_s = dynamics.time_limit_s
        # of what does not change, one observation anywhere counts
        moving = all(is_moving(name) for _, name in features(*dynamics.conditions))
        return TrackReach(limit_s, self.options.gap_s) if limit_s is not None and moving else None

    def intervals(
        self, table: StartTable, remember: Callable[[int], StartLabel], *, every: bool = True,
        label: LabelOf | None = None,
    ) -> BindingOutcome:  # fmt: skip
        """What became of each binding: the intervals to report, or else the one that came furthest.

        Args:
            table: The starts.
            remember: Gives the label of a start by its number, with the correspondence.
            every: Whether bindings without an interval are told of, too.
            label: Makes labels of samples at which objects come.
        """
        origin = np.arange(len(table))
        self._label = label
        if self._arrivals is not None and len(table):
            try:
                table, origin = self._arrivals.widened(table, self.options.gap_s, label)
            except Exhausted as error:
                return self._unknown(table, str(error))
        order, bindings = _sorted(table)
        table = table.chosen(order)
        order = origin[order]
        parts: list[Runs] = []
        for outcome in cast("list[int]", np.unique(table.outcomes).tolist()):
            which = np.flatnonzero(table.outcomes == outcome)
            # a machine has met nothing before, so that what becomes of a block depends on no other one
            own = table.chosen(which)
            program = _Program(InitialScene(self.outcomes[outcome].scenario, self.match, self.solver))

            def remembered(number: int, which: NDArray[np.int64] = which) -> StartLabel:
                return remember(int(order[which[number]]))

            for stretches in stretches_of(own, self.options.gap_s, apart=program.apart, classes=self.match.classes):
                for some, runs in self._followed(program, stretches, own, remembered):
                    parts.append(runs.renumbered(which[some.numbers], some.labels))
        if not parts:
            return BindingOutcome([])
        look()
        found = Runs.joined(parts)
        found = replace(found, truth=np.minimum(found.truth, np.where(table.sure[found.owner], TRUE, UNKNOWN)))
        return self._reported(found, table, order, bindings, every=every)

    def _unknown(self, table: StartTable, reason: str) -> BindingOutcome:
        """That nothing is known of any start."""
        labels = np.unique(table.labels)
        recordings = table.block.recording_of[labels]
        firsts = np.array([first for first, _ in table.block.runs], dtype=np.int64)[recordings]
        rows = zip((labels - firsts).tolist(), recordings.tolist(), strict=True)
        found = [IntervalVerdict(at, at, int(UNKNOWN), (), recording, reason=reason) for at, recording in rows]
        return BindingOutcome(found, len(table))

    def _followed(
        self, program: _Program, stretches: Stretches, table: StartTable, remember: Callable[[int], StartLabel]
    ) -> Iterator[tuple[Stretches, Runs]]:
        """The runs of some stretches, those together in which the same features are observed."""
        dynamics = program.scenario.dynamics
        if dynamics is None:
            yield stretches, _static(stretches, table)
            return
        for places in group_by_observed(stretches.places, *dynamics.conditions, stretches=stretches.bounds[:-1]):
            some = stretches if len(places) == len(stretches.labels) else stretches.some(places)
            columns = AtomColumns(program.scenario, some.places, start=some.heads())
            expanded = [columns.expanded(condition) for condition in dynamics.conditions]
            look()
            runs = self._dynamic(program, some, columns, expanded, remember)
            look()
            _tell_budget(runs, some, columns)
            yield some, runs

    def _dynamic(
        self, program: _Program, stretches: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        remember: Callable[[int], StartLabel],
    ) -> Runs:  # fmt: skip
        assert program.machine is not None
        if random_variables(expanded):
            hidden = HiddenRuns(program.machine, program.initial, self.reasons)
            return hidden.follow(stretches, columns, expanded, remember)
        given: Mapping[int, Truth] = {}
        if self._arrivals is not None:
            given = self._arrivals.truths(stretches.places, stretches.bounds, self._label)
        return follow_runs(program.machine, stretches, columns.reader(expanded, given))

    def _reported(
        self, found: Runs, table: StartTable, order: NDArray[np.int64], bindings: NDArray[np.int64], *, every: bool
    ) -> BindingOutcome:
        """What is reported of the runs of all bindings.

        Args:
            found: The runs, from labels to labels.
            table: The starts.
            order: What the number of each was.
            bindings: The number of the binding of each.
            every: See `intervals`.
        """
        starts, ends, truth = found.starts, found.ends, found.truth
        times = table.block.times_us
        lasting = (times[ends] - times[starts]) / 1e6
        least = self.options.min_duration_s or 0.0
        own = bindings[found.owner]
        count = len(np.unique(own))
        fit = (truth > FALSE) & (lasting >= least - 1e-6)
        # of most bindings no interval or one is in question
        many = np.bincount(own[fit], minlength=int(own.max()) + 1)
        alone = np.flatnonzero(fit & (many[own] == 1))
        several = np.flatnonzero(fit & (many[own] > 1))
        shift = _one_after_the_other(own[several], starts[several], ends[several])
        first, last = starts[several] + shift, ends[several] + shift
        if len(self.outcomes) > 1:
            surest = _surest(first, last, truth[several])
            several, first, last = several[surest], first[surest], last[surest]
        look()
        kept = several[choose_intervals(first, last, truth[several], lasting[several], self.options.intervals, least)]
        told = self._verdicts(found.some(np.concatenate((alone, kept))), table, order)
        # what was cut off might have matched; else what was matched but is too short, else what came furthest
        open_ = np.flatnonzero(many[own] == 0)
        broken = cast("list[Span | None]", found.broken[open_].tolist())
        hopeful = found.cut_off[open_] & np.array([each is None for each in broken], dtype=np.bool_)
        last = np.lexsort((-open_, -starts[open_], (ends - starts)[open_], truth[open_], hopeful, own[open_]))
        best = found.some(open_[last[np.append(np.diff(own[open_[last]]) != 0, True)]] if len(open_) else open_)
        others: Counter[tuple[Span | None, bool]] = Counter()
        if every:
            told += self._verdicts(best.with_detail("", truth=int(FALSE)), table, order)
        else:
            others.update(zip(best.broken.tolist(), best.cut_off.tolist(), strict=True))
        told.sort(key=lambda each: (each.recording, each.start, each.end, each.binding))
        return BindingOutcome(told, count, others)

    def _verdicts(self, runs: Runs, table: StartTable, order: NDArray[np.int64]) -> list[IntervalVerdict]:
        """Runs, one by one; arguments as of `_reported`."""
        block = table.block
        recordings = block.recording_of[runs.starts]
        firsts = np.array([first for first, _ in block.runs], dtype=np.int64)[recordings]
        tracks = [
            [(index, key) for key in block.keys(members[runs.owner])]
            for index, members in sorted(table.members.items())
        ]
        columns = (
            runs.starts - firsts,
            runs.ends - firsts,
            runs.truth,
            recordings,
            order[runs.owner],
            runs.cut_off,
        )
        outcomes = [self.outcomes[each] for each in cast("list[int]", table.outcomes[runs.owner].tolist())]
        rows = zip(*(each.tolist() for each in columns), strict=True)
        sure = cast("list[bool]", table.sure[runs.owner].tolist())
        details = cast("list[Detail | None]", runs.details.tolist())
        broken = cast("list[Span | None]", runs.broken.tolist())
        nothing: Detail = "", {}
        found: list[IntervalVerdict] = []
        for place, (binding, row) in enumerate(zip(zip(*tracks, strict=True), rows, strict=True)):
            start, end, truth, recording, origin, cut_off = row
            reason, witness = details[place] or nothing
            if truth == UNKNOWN and sure[place]:
                reason = reason or "unobserved"
            values = {**outcomes[place].witness, **witness} if truth == TRUE else {}
            found.append(
                IntervalVerdict(start, end, truth, binding, recording, origin, values, reason, broken[place], cut_off)
            )
        return found


def _one_after_the_other(
    own: NDArray[np.int64], starts: NDArray[np.int64], ends: NDArray[np.int64]
) -> NDArray[np.int64]:
    """By how much to shift intervals so that those of one binding lie behind those of another.

    Args:
        own: The binding of each.
        starts: First samples.
        ends: Last samples.
    """
    _, which = np.unique(own, return_inverse=True)
    count = int(which.max(initial=-1)) + 1
    low, high = np.full(count, np.iinfo(np.int64).max), np.zeros(count, np.int64)
    np.minimum.at(low, which, starts)
    np.maximum.at(high, which, ends)
    sizes = high - low + 1
    return (np.cumsum(sizes) - sizes - low)[which]


def _surest(starts: NDArray[np.int64], ends: NDArray[np.int64], truth: Truth) -> NDArray[np.int64]:
    """The numbers of runs without those that another outcome makes as sure at least, from one sample to another."""
    ordered = np.lexsort((-truth.astype(np.int64), ends, starts))
    same = (starts[ordered][1:] == starts[ordered][:-1]) & (ends[ordered][1:] == ends[ordered][:-1])
    return ordered[np.concatenate(([True], ~same))] if len(ordered) else ordered


def _sorted(table: StartTable) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The order of starts by binding and time, and the number of each one's binding in that order.

    A correspondence in which a track plays two objects, which a label can have twice, is left out.
    """
    tracks = np.column_stack([table.block.tracks(members) for _, members in sorted(table.members.items())])
    ordered = np.sort(tracks, axis=1)
    distinct = np.flatnonzero((ordered[:, 1:] != ordered[:, :-1]).all(axis=1))
    tracks = tracks[distinct]
    order = np.lexsort((table.labels[distinct], *tracks.T[::-1]))
    changes = (tracks[order][1:] != tracks[order][:-1]).any(axis=1)
    return distinct[order], np.concatenate(([0], np.cumsum(changes))) if len(order) else np.empty(0, np.int64)


def _tell_budget(runs: Runs, stretches: Stretches, columns: AtomColumns) -> None:
    """Tell of runs that are unknown, and nothing is told of, whether a limit is why."""
    limited = runs.undecided.copy()
    for undecided in columns.undecided:
        before = np.concatenate(([0], np.cumsum(undecided)))
        limited |= before[stretches.ends()[runs.owner] + 1] > before[stretches.starts[runs.owner]]
    for each in np.flatnonzero(limited & (runs.truth == UNKNOWN)).tolist():
        runs.details[each] = runs.details[each] or ("budget", {})


def _static(stretches: Stretches, table: StartTable) -> Runs:
    """Maximal runs of samples that each match, and those with samples among them of which that is not known."""
    n = len(stretches.labels)
    states = np.full(n, FALSE)
    for members in stretches.places.members.values():
        states[members < 0] = UNKNOWN
    states[stretches.starts] = UNKNOWN
    states[stretches.starts[table.sure[stretches.numbers]]] = TRUE
    # runs end where stretches do
    heads = np.zeros(n + 1, np.bool_)
    heads[stretches.bounds] = True
    pieces: list[tuple[tuple[NDArray[np.int64], NDArray[np.int64]], Truth]] = []
    for level in (TRUE, UNKNOWN):
        possible = np.append(states >= level, False)
        first = np.flatnonzero(possible[:-1] & (heads[:-1] | ~np.concatenate(([False], possible[:-2]))))
        end = np.flatnonzero(possible[:-1] & (heads[1:] | ~possible[1:]))
        if level == UNKNOWN:
            open_ = np.concatenate(([0], np.cumsum(states == UNKNOWN)))
            unsure = open_[end + 1] > open_[first]
            first, end = first[unsure], end[unsure]
        pieces.append(((first, end), np.full(len(first), level)))
    first, end = (np.concatenate([piece[part] for piece, _ in pieces]) for part in (0, 1))
    truth = np.concatenate([level for _, level in pieces])
    # the first start from there on, which may lie behind the run
    number = np.minimum(np.searchsorted(stretches.starts, first), len(stretches.starts) - 1)
    last = (
        np.searchsorted(stretches.starts, stretches.bounds[np.searchsorted(stretches.bounds, first, side="right")]) - 1
    )
    runs = Runs.unknown(first, end)
    return replace(runs, owner=np.minimum(number, last), truth=truth)
