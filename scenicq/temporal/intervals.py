"""The intervals of one recording that match: bindings and start samples in, intervals out (see `IntervalMatcher`).

A binding gives each object of the scenario a track, for the whole interval. A start is a sample whose label matches
the initial scene under a binding. From the starts of one binding all runs are followed together, on columns over the
samples in which all tracks live; where conditions hang on random variables of the scene, once for each cell of values.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import TimeIsUp, limited, look
from scenicq.errors import Span
from scenicq.forest.nodes import Compare, CompareOp, Constant, Leaf, Logic, LogicOp, Node
from scenicq.forest.scenario import Requirement, Scenario
from scenicq.forest.simplify import roots_of
from scenicq.forest.temporal import Atom, Dynamics
from scenicq.forest.walk import leaves
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, Unknown, WitnessValue
from scenicq.smt.answer import Solver
from scenicq.store.labels import Label
from scenicq.store.tracks import RecordingTracks, TrackKey
from scenicq.temporal.atoms import AtomColumns, HiddenVariable, reads_start
from scenicq.temporal.hidden import Cell, UnclearVariable, cells, random_variables
from scenicq.temporal.interval_options import IntervalOptions
from scenicq.temporal.runs import Run, runs_from
from scenicq.temporal.samples import Samples
from scenicq.temporal.selection import chosen
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["Interval", "IntervalMatcher", "Start"]

_MOST_JOINT = 32
"""Starts of one binding that are matched again with values of random variables that the initial scene has, too."""


@dataclass(frozen=True, slots=True)
class Start:
    """A sample whose label matches the initial scene, or may.

    Attributes:
        sample: Its number in the recording.
        binding: The track of each object, by index.
        verdict: A match, or unknown.
        label: The label.
        correspondence: The label object of each object, by name.
    """

    sample: int
    binding: tuple[tuple[int, TrackKey], ...]
    verdict: Match | Unknown
    label: Label
    correspondence: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Interval:
    """What became of a binding in an interval of a recording.

    Attributes:
        start, end: First and last sample.
        truth: Whether it matches.
        binding: As of `Start`.
        witness: Values of random variables that prove a match, by their place in the program.
        reason: Why it is unknown.
        broken: What keeps it from matching, in the program.
        cut_off: Whether the recording or a track ends before the program does.
    """

    start: int
    end: int
    truth: int
    binding: tuple[tuple[int, TrackKey], ...]
    witness: Mapping[str, WitnessValue] = field(default_factory=dict["str", "WitnessValue"])
    reason: str = ""
    broken: Span | None = None
    cut_off: bool = False


@dataclass(eq=False)
class IntervalMatcher:
    """A scenario made ready to be matched against recordings of one map.

    Attributes:
        scenario: The scenario, made ready to be matched.
        match: Options of the matcher, for initial scenes.
        options: Of intervals.
        solver: Decides what is not decided otherwise.
    """

    scenario: Scenario
    match: MatchOptions
    options: IntervalOptions
    solver: Solver | None = None

    def __post_init__(self) -> None:
        """Find out what conditions over time share with the initial scene."""
        still = replace(self.scenario, dynamics=None)
        self._shared = {leaf.identity for leaf in leaves(*roots_of(still))}

    def intervals(self, tracks: RecordingTracks, starts: Iterable[Start]) -> list[Interval]:
        """What became of each binding: the intervals to report, or else the one that came furthest.

        Args:
            tracks: The recording.
            starts: Its starts, in order of time.
        """
        by_binding: dict[tuple[tuple[int, TrackKey], ...], list[Start]] = {}
        for start in starts:
            by_binding.setdefault(start.binding, []).append(start)
        found: list[Interval] = []
        for binding, mine in by_binding.items():
            runs = [*self._of_binding(tracks, binding, mine)]
            positive = [each for each in runs if each.truth > FALSE]
            least = self.options.min_duration_s or 0.0
            kept = chosen(positive, tracks.seconds, self.options.intervals, least)
            if kept:
                found += kept
            elif runs:
                # what was cut off might have matched; else what was matched but is too short, else what came furthest
                best = max(runs, key=lambda each: (each.cut_off, each.truth, each.end - each.start, -each.start))
                found.append(replace(best, truth=int(FALSE)))
        return sorted(found, key=lambda each: (each.start, each.end, each.binding))

    def _of_binding(
        self, tracks: RecordingTracks, binding: tuple[tuple[int, TrackKey], ...], starts: Sequence[Start]
    ) -> Iterator[Interval]:
        ends = self.life_ends(tracks, binding)
        for end, group in groupby(starts, key=lambda start: int(ends[start.sample])):
            mine = list(group)
            samples = Samples(tracks, dict(binding), mine[0].sample, end + 1)
            if self.scenario.dynamics is None:
                yield from _static(samples, binding, mine)
            else:
                yield from self._dynamic(samples, binding, mine)

    def life_ends(self, tracks: RecordingTracks, binding: tuple[tuple[int, TrackKey], ...]) -> NDArray[np.intp]:
        """For each sample at which all tracks of a binding are observed, the last one of their common life."""
        found = np.full(len(tracks), len(tracks) - 1)
        for _, track in binding:
            there = np.flatnonzero(~np.isnan(tracks.column(track, "x")))
            breaks = np.flatnonzero(np.diff(tracks.seconds[there]) > self.options.gap_s)
            last = there[np.append(breaks, len(there) - 1)] if len(there) else there
            mine = np.arange(len(tracks))
            if len(last):
                mine = last[np.minimum(np.searchsorted(last, mine), len(last) - 1)]
            found = np.minimum(found, np.maximum(mine, np.arange(len(tracks))))
        return found

    def _dynamic(
        self, samples: Samples, binding: tuple[tuple[int, TrackKey], ...], starts: Sequence[Start]
    ) -> Iterator[Interval]:
        dynamics = self.scenario.dynamics
        assert dynamics is not None
        columns = AtomColumns(self.scenario, samples)
        expanded = [columns.expanded(condition) for condition in dynamics.conditions]
        if any(map(reads_start, expanded)):
            for start in starts:
                from_it = columns.started(start.sample - samples.first)
                yield from self._from_starts(dynamics, from_it, expanded, samples, binding, [start])
        else:
            yield from self._from_starts(dynamics, columns, expanded, samples, binding, starts)

    def _from_starts(
        self, dynamics: Dynamics, columns: AtomColumns, expanded: Sequence[Node], samples: Samples,
        binding: tuple[tuple[int, TrackKey], ...], starts: Sequence[Start],
    ) -> Iterator[Interval]:  # fmt: skip
        """What becomes of runs that share the values of all conditions."""
        if not random_variables(expanded):
            for run, start in zip(_follow(dynamics, columns, expanded, samples, starts), starts, strict=True):
                yield _interval(run, start, samples, binding)
            return
        try:
            with limited(self.match.timeout_s):
                found = list(self._over_cells(dynamics, columns, expanded, samples, binding, starts))
            yield from found
        except (UnclearVariable, HiddenVariable, TimeIsUp) as error:
            reason = "timeout" if isinstance(error, TimeIsUp) else str(error) or "a hidden random variable over time"
            for start in starts:
                yield Interval(start.sample, samples.end - 1, int(UNKNOWN), binding, reason=reason)

    def _over_cells(
        self, dynamics: Dynamics, columns: AtomColumns, expanded: Sequence[Node], samples: Samples,
        binding: tuple[tuple[int, TrackKey], ...], starts: Sequence[Start],
    ) -> Iterator[Interval]:  # fmt: skip
        """The best that any values of the random variables make of each start."""
        variables = random_variables(expanded)
        joint = [leaf for leaf in variables if leaf.identity in self._shared]
        found: list[list[tuple[Run, Cell]]] = [[] for _ in starts]
        for cell in cells(columns, expanded):
            look()
            runs = _follow(dynamics, columns.assigned(cell.values), expanded, samples, starts)
            for mine, run in zip(found, runs, strict=True):
                mine.append((run, cell))
        matched_again = 0
        for start, mine in zip(starts, found, strict=True):
            ranked = sorted(mine, key=lambda each: (-each[0].truth, -each[0].end))
            best, cell = ranked[0]
            reason = ""
            if joint and best.truth > FALSE:
                matched_again += 1
                if matched_again > _MOST_JOINT:
                    best, reason = replace(best, truth=int(UNKNOWN)), "budget"
                else:
                    best, cell, reason = self._jointly(start, joint, ranked)
            interval = _interval(best, start, samples, binding)
            if interval.truth == TRUE:
                values = {_place(leaf): cell.values[leaf.identity] for leaf in variables}
                witness = {**interval.witness, **{k: v for k, v in values.items() if isinstance(v, float)}}
                interval = replace(interval, witness=witness)
            yield replace(interval, reason=reason or interval.reason)

    def _jointly(
        self, start: Start, joint: Sequence[Leaf], ranked: Sequence[tuple[Run, Cell]]
    ) -> tuple[Run, Cell, str]:
        """The best run whose values of random variables the initial scene has, too."""
        ids = dict(start.correspondence)
        undecided: tuple[Run, Cell, str] | None = None
        for (_, _), group in groupby(ranked, key=lambda each: (each[0].truth, each[0].end)):
            same = list(group)
            if same[0][0].truth == FALSE:
                break
            within = _within(joint, [cell for _, cell in same])
            scenario = replace(
                self.scenario,
                requirements=(*self.scenario.requirements, Requirement(within, None)),
                dynamics=None,
            )
            given = {name: id_ for name, id_ in ids.items() if name != self.scenario.objects[self.scenario.ego].name}
            verdict = Matcher(scenario, self.match, self.solver).match(start.label, given=given)
            if isinstance(verdict, Match):
                values = [verdict.witness.get(_place(leaf)) for leaf in joint]
                held = next((each for each in same if _holds(each[1], joint, values)), same[0])
                return *held, ""
            if isinstance(verdict, Unknown) and undecided is None:
                undecided = replace(same[0][0], truth=int(UNKNOWN)), same[0][1], verdict.reason
        run, cell = ranked[-1]
        return undecided or (replace(run, truth=int(FALSE)), cell, "")


def _follow(
    dynamics: Dynamics, columns: AtomColumns, expanded: Sequence[Node], samples: Samples, starts: Sequence[Start]
) -> list[Run]:
    known: dict[int, Truth] = {}

    def atom(each: Atom) -> Truth:
        if each.number not in known:
            known[each.number] = columns.truth_of(expanded[each.number])
        return known[each.number]

    return runs_from(dynamics, atom, samples.seconds(), [start.sample - samples.first for start in starts])


def _interval(run: Run, start: Start, samples: Samples, binding: tuple[tuple[int, TrackKey], ...]) -> Interval:
    truth = min(run.truth, int(TRUE if isinstance(start.verdict, Match) else UNKNOWN))
    witness: Mapping[str, WitnessValue] = (
        start.verdict.witness if isinstance(start.verdict, Match) else dict[str, WitnessValue]()
    )
    reason = "" if truth != UNKNOWN else "unobserved" if isinstance(start.verdict, Match) else start.verdict.reason
    first = samples.first
    return Interval(first + run.start, first + run.end, truth, binding, witness, reason, run.broken, run.cut_off)


def _static(samples: Samples, binding: tuple[tuple[int, TrackKey], ...], starts: Sequence[Start]) -> Iterator[Interval]:
    """Maximal runs of samples that each match, and those with samples among them of which that is not known."""
    states = np.full(len(samples), FALSE)
    for index, _ in binding:
        states[~samples.present(index)] = UNKNOWN
    at: dict[int, Start] = {}
    for start in starts:
        place = start.sample - samples.first
        states[place] = TRUE if isinstance(start.verdict, Match) else UNKNOWN
        at.setdefault(place, start)
    for truth, possible in ((TRUE, states == TRUE), (UNKNOWN, states >= UNKNOWN)):
        edges = np.flatnonzero(np.diff(np.concatenate(([False], possible, [False])).astype(np.int8)))
        for first, end in edges.reshape(-1, 2).tolist():
            if truth == TRUE or (states[first:end] == UNKNOWN).any():
                yield _interval(Run(first, end - 1, int(truth)), _nearest(at, first), samples, binding)


def _nearest(at: Mapping[int, Start], sample: int) -> Start:
    """The first start from a sample on."""
    return at[min((place for place in at if place >= sample), default=max(at))]


def _place(leaf: Leaf) -> str:
    return leaf.span.place if leaf.span else type(leaf).__name__


def _within(joint: Sequence[Leaf], some: Sequence[Cell]) -> Node:
    """That random variables have values of some cells."""
    options: list[Node] = []
    for cell in some:
        bounds: list[Node] = []
        for leaf in joint:
            low, high = cell.ranges[leaf.identity]
            for op, end in ((CompareOp.GE, low), (CompareOp.LE, high)):
                if np.isfinite(end):
                    bounds.append(Compare(op, leaf, Constant(float(end))))
        options.append(Logic(LogicOp.AND, tuple(bounds)) if bounds else Constant(True))
    return options[0] if len(options) == 1 else Logic(LogicOp.OR, tuple(options))


def _holds(cell: Cell, joint: Sequence[Leaf], values: Sequence[WitnessValue | None]) -> bool:
    """Whether a witness has its values in a cell."""
    return all(
        isinstance(value, float) and cell.ranges[leaf.identity][0] <= value <= cell.ranges[leaf.identity][1]
        for leaf, value in zip(joint, values, strict=True)
    )
