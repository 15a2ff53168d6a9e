"""The recordings of a block decided: the labels that are left side by side, then intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import look
from scenicq.errors import Span
from scenicq.forest.among import properties_of_others
from scenicq.forest.scenario import Scenario
from scenicq.match.matcher import Matcher
from scenicq.match.problem.constraints import relevant_properties
from scenicq.match.tolerance import SLACK
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown, Verdict, WitnessValue
from scenicq.query.execution.recording_starts import (
    DecidedStart,
    NearestRoles,
    decided_starts,
    find_starts,
    make_start_label,
    order_by_distance,
    start_table,
)
from scenicq.query.execution.results import IntervalSpan, Result
from scenicq.query.prefilter.executor import Block
from scenicq.query.prefilter.survivors import Candidate, CandidateRows
from scenicq.store.classes import class_matches
from scenicq.store.dataset import Dataset
from scenicq.store.track_block import TrackBlock
from scenicq.store.tracks import TrackKey
from scenicq.temporal.hidden_runs import StartLabel
from scenicq.temporal.intervals import IntervalMatcher, IntervalVerdict
from scenicq.temporal.necessary import NecessaryConditions
from scenicq.temporal.outcomes import Outcome
from scenicq.temporal.starts import RoleCandidates, StartMatchers, StartSearch, narrow_candidates
from scenicq.temporal.stretches import StartTable
from scenicq.temporal.truth import TRUE, UNKNOWN

__all__ = ["CUT_OFF", "DecidedRecordings", "RecordingMatcher", "Survivors", "lost_recording"]

CUT_OFF = "recording-ends"
"""The cause of what might have matched, had the recording or a track gone on."""


@dataclass(slots=True)
class DecidedRecordings:
    """What became of the recordings of a block.

    Attributes:
        results: One for each interval, in order; of a binding without one, how far it came.
        counts: See `Funnel.over_time`.
        failed: What frames failed at that are not excluded by the prefilter, and are no starts.
        broken: What bindings without an interval failed at that are not among the results.
    """

    results: list[Result] = field(default_factory=list[Result])
    counts: Counter[str] = field(default_factory=Counter[str])
    failed: Counter[str] = field(default_factory=Counter[str])
    broken: Counter[str] = field(default_factory=Counter[str])

    @classmethod
    def nothing(cls, rows: Block) -> DecidedRecordings:
        """What becomes of a block of whole recordings in which nothing starts."""
        return cls(counts=Counter(recordings=len(rows.runs)))

    def add(self, other: DecidedRecordings) -> None:
        """Take in what became of the recordings that follow."""
        self.results += other.results
        for mine, theirs in ((self.counts, other.counts), (self.failed, other.failed), (self.broken, other.broken)):
            mine.update(theirs)


@dataclass(frozen=True, slots=True)
class Survivors:
    """The labels of a block that the prefilter has left.

    Attributes:
        labels: Their rows in the part.
        rows: Who may play the roles; None where anybody of the class may.
        roles: The objects of the scenario that `rows` is about.
        read: Reads some of them, by their rows. With `rows`, they have the label objects of these alone.
    """

    labels: NDArray[np.int64]
    rows: CandidateRows | None
    roles: tuple[int, ...]
    read: Callable[[NDArray[np.int64]], Iterator[Candidate]]

    def within(self, rows: Block, objects: tuple[int, int] | None) -> Survivors:
        """Select the survivors of some recordings of the block.

        Args:
            rows: The recordings.
            objects: Where their label objects are: the first row, and that behind the last; None where nobody asks.
        """
        low, high = np.searchsorted(self.labels, (rows.first, rows.end)).tolist()
        mine = self.rows if self.rows is None or objects is None else self.rows.between(*objects)
        return Survivors(self.labels[low:high], mine, self.roles, self.read)


@dataclass(frozen=True, slots=True)
class _Asked:
    """Labels of which starts are looked for.

    Attributes:
        block: Has them.
        labels: Their places in the block.
        candidates: Who may play whom, if that is a matter of the label's own ego.
        read: As of `Survivors`.
    """

    block: TrackBlock
    labels: NDArray[np.int64]
    candidates: RoleCandidates | None
    read: Callable[[NDArray[np.int64]], Iterator[Candidate]]

    def some(self, which: NDArray[np.bool_]) -> _Asked:
        """Some of them."""
        candidates = self.candidates
        if candidates is not None:
            place = np.searchsorted(candidates.labels, self.block.label_of[candidates.members])
            candidates = narrow_candidates(candidates, which, place)
        return _Asked(self.block, self.labels[which], candidates, self.read)


@dataclass(frozen=True, slots=True)
class _Starts:
    """What is found of labels.

    Attributes:
        table: The starts.
        decided: Those of them that the matcher has decided, by their numbers.
        undecided: Labels that stay undecided, by their places in the block.
    """

    table: StartTable
    decided: Mapping[int, DecidedStart]
    undecided: Mapping[int, Unknown]

    @classmethod
    def joined(cls, parts: Sequence[_Starts]) -> _Starts:
        """The starts with one outcome after the other."""
        decided: dict[int, DecidedStart] = {}
        undecided: dict[int, Unknown] = {}
        first = 0
        for part in parts:
            decided.update({first + number: each for number, each in part.decided.items()})
            undecided.update({at: each for at, each in part.undecided.items() if at not in undecided})
            first += len(part.table)
        return cls(StartTable.joined([part.table for part in parts]), decided, undecided)


@dataclass(eq=False)
class RecordingMatcher:
    """What a process keeps between blocks.

    Attributes:
        dataset: The dataset.
        matcher: For the initial scene.
        intervals: For what follows.
        every: Whether bindings without an interval are results, too.
        proofs: Whether somebody reads the values that prove matches.
        reasons: Whether somebody reads what frames and bindings fail at.
    """

    dataset: Dataset
    matcher: Matcher
    intervals: IntervalMatcher
    every: bool = True
    proofs: bool = True
    reasons: bool = True

    def __post_init__(self) -> None:
        """Choose what is decided before labels are matched."""
        self._whole = properties_of_others(self.matcher.scenario) is not None
        self._necessary = None if self.reasons else NecessaryConditions(self.matcher.scenario)
        outcomes = self.intervals.outcomes
        if len(outcomes) == 1:
            # what is decided over time alone is no matter of the initial scene
            self.matcher = Matcher(outcomes[0].scenario, self.matcher.options, self.matcher.solver)
        self._matchers = StartMatchers(self.matcher, outcomes)
        self.matcher = self._matchers.whole
        self._search = StartSearch(self.matcher)
        self._searches: dict[int, StartSearch] = {}
        self._relevant = relevant_properties(self.matcher.scenario, self.matcher.options)

    def decide(self, rows: Block, left: Survivors) -> DecidedRecordings:
        """Decide a block of whole recordings.

        Args:
            rows: The block.
            left: Its labels that may be starts.
        """
        found = DecidedRecordings.nothing(rows)
        if not len(left.labels):
            return found
        players = None if left.rows is None or self._whole else left.rows.rows
        look()
        with TrackBlock(self.dataset, rows.part, rows.runs, players, self.intervals.reach) as block:
            look()
            labels = left.labels - block.first_label
            candidates = self._candidates(block, labels, left)
            if candidates is not None and self._necessary is not None:
                candidates = self._necessary.narrow(block, candidates)
                labels = candidates.labels
            asked = _Asked(block, labels, candidates, left.read)
            starts = self._starts(asked, self._search, 0, found)
            found.counts["starts"] += len(np.unique(starts.table.labels)) + len(starts.undecided)
            if len(self.intervals.outcomes) > 1:
                starts = self._by_outcomes(asked, starts)
            table, by_number, undecided = starts.table, starts.decided, starts.undecided

            def remember(number: int) -> StartLabel:
                if number in by_number:
                    return by_number[number].label, by_number[number].correspondence
                members = {index: int(mine[number]) for index, mine in table.members.items()}
                return make_start_label(self.matcher.scenario, block, members, rows.map, self._relevant)

            def label(scenario: Scenario, members: Mapping[int, int], relevant: Sequence[frozenset[str]]) -> StartLabel:
                return make_start_label(scenario, block, members, rows.map, relevant)

            reported = self.intervals.intervals(table, remember, every=self.every, label=label)
            look()
            intervals = reported.intervals
            found.counts["bindings"] += reported.bindings
            found.counts["cut off"] += sum(each.cut_off and each.broken is None for each in intervals)
            for (broken, cut_off), count in reported.others.items():
                found.broken[_what(broken, cut_off=cut_off)] += count
                found.counts["cut off"] += count if cut_off and broken is None else 0
            results = [
                (int(block.recording_of[at]), _undecided(block, at, verdict)) for at, verdict in undecided.items()
            ]
            results += self._results(rows, block, intervals, starts)
            found.results += [result for _, result in sorted(results, key=lambda each: each[0])]
        return found

    # --- starts

    def _by_outcomes(self, asked: _Asked, whole: _Starts) -> _Starts:
        """The starts with each outcome of the choices over time, among those with any."""
        labels = np.union1d(whole.table.labels, np.array(list(whole.undecided), dtype=np.int64))
        some = asked.some(np.isin(asked.labels, labels))
        parts: list[_Starts] = []
        for number, outcome in enumerate(self.intervals.outcomes):
            if outcome.same_start:
                again = replace(whole.table, outcomes=np.full(len(whole.table), number))
                parts.append(replace(whole, table=again))
                continue
            near = self._near(some, outcome)
            if near.any():
                parts.append(self._starts(some.some(near), self._search_of(number), number, DecidedRecordings()))
        none = _Starts(start_table(self.matcher.scenario, asked.block, {}, [], 0), {}, {})
        return _Starts.joined(parts or [none])

    def _near(self, asked: _Asked, outcome: Outcome) -> NDArray[np.bool_]:
        """The labels that have, for each role, a label object where an outcome may put it: a lane is not everywhere."""
        candidates, n = asked.candidates, len(asked.labels)
        found = np.ones(n, np.bool_)
        if candidates is None:
            return found
        x, y = asked.block.numbers("x"), asked.block.numbers("y")
        place = np.searchsorted(candidates.labels, asked.block.label_of[candidates.members])
        for role, box in outcome.start_boxes.items():
            reach = self.matcher.options.tolerance.of(role, "position").reach + SLACK
            is_ego = role == self.matcher.scenario.ego
            members = asked.block.ego(asked.labels) if is_ego else candidates.members[candidates.may[role]]
            (west, east), (south, north) = box
            off_x = (x[members] < west - reach) | (x[members] > east + reach)
            off_y = (y[members] < south - reach) | (y[members] > north + reach)
            inside = ~(off_x | off_y)
            found &= inside if is_ego else np.bincount(place[candidates.may[role]][inside], minlength=n) > 0
        return found

    def _search_of(self, outcome: int) -> StartSearch:
        """What finds the starts with an outcome of the choices over time."""
        if self.intervals.outcomes[outcome].same_start:
            return self._search
        if outcome not in self._searches:
            self._searches[outcome] = StartSearch(self._matchers[outcome])
        return self._searches[outcome]

    def _starts(self, asked: _Asked, search: StartSearch, outcome: int, found: DecidedRecordings) -> _Starts:
        """Starts that arrays have, those that the matcher has decided, and the labels that stay undecided."""
        block, labels, candidates = asked.block, asked.labels, asked.candidates
        arrays: Mapping[int, NDArray[np.int64]] = {}
        sure = np.zeros(len(labels), np.bool_)
        codes, classes = block.categories()
        own: list[int] = np.unique(codes[block.ego(labels)]).tolist()
        if candidates is not None and all(classes[code] for code in own):
            look()
            starts = search.decide(block, candidates)
            arrays, candidates, sure = starts.members, starts.left, starts.sure
            labels = candidates.labels
            found.failed.update(starts.failed)
        decided: list[DecidedStart] = []
        undecided: dict[int, Unknown] = {}
        known_starts: dict[int, Counter[str]] = {}
        read = asked.read(labels + block.first_label) if len(labels) else iter(())
        for at, candidate, members, among, known in self._asked(block, labels, candidates, sure, read):
            look()
            matcher = search.rest if known else search.matcher
            label = candidate.label
            recording = int(block.recording_of[at])
            findings = find_starts(matcher, label, known_starts.setdefault(recording, Counter()), among=among)
            for each in findings:
                if isinstance(each.verdict, NoMatch):
                    found.failed[each.verdict.cause.what] += 1
            for start in decided_starts(self.matcher.scenario, block, label, members, findings):
                if isinstance(start, Unknown):
                    undecided[at] = start
                else:
                    decided.append(start)
        table = start_table(self.matcher.scenario, block, arrays, decided, outcome)
        return _Starts(table, dict(enumerate(decided, len(table) - len(decided))), undecided)

    def _candidates(self, block: TrackBlock, labels: NDArray[np.int64], left: Survivors) -> RoleCandidates | None:
        """The candidates of each role; None unless the ego is the label's own."""
        scenario, options = self.matcher.scenario, self.matcher.options
        if options.ego != "label" or options.exact:
            return None
        if left.rows is not None:
            may = {index: left.rows.may[:, place] for place, index in enumerate(left.roles)}
            return RoleCandidates(labels, block.members(left.rows.rows), may)
        members = _objects_of(block, labels)
        codes, classes = block.categories()
        fits: dict[str, NDArray[np.bool_]] = {}
        may: dict[int, NDArray[np.bool_]] = {}
        for owner in scenario.objects:
            if owner.index != scenario.ego:
                if owner.category not in fits:
                    own = [bool(each) and class_matches(owner.category, each, options.classes) for each in classes]
                    fits[owner.category] = np.array(own, dtype=np.bool_)[codes[members]]
                may[owner.index] = fits[owner.category]
        return RoleCandidates(labels, members, may)

    def _asked(
        self, block: TrackBlock, labels: NDArray[np.int64], candidates: RoleCandidates | None,
        sure: NDArray[np.bool_], read: Iterator[Candidate],
    ) -> Iterator[tuple[int, Candidate, list[int], Mapping[int, tuple[int, ...]] | None, bool]]:  # fmt: skip
        """Labels for the matcher, with their members, candidates of the roles, and whether plain requirements hold."""
        members = _objects_of(block, labels) if candidates is None or self._whole else candidates.members
        plays: dict[int, NDArray[np.bool_]] = {}
        if candidates is not None:
            for index, may in candidates.may.items():
                every = np.zeros(block.object_count, np.bool_)
                every[candidates.members] = may
                plays[index] = every[members]
        ends = np.searchsorted(block.label_of[members], np.append(labels, len(block))).tolist()
        for place, (at, candidate) in enumerate(zip(labels.tolist(), read, strict=True)):
            mine = slice(ends[place], ends[place + 1])
            among: Mapping[int, tuple[int, ...]] | None = candidate.among
            if candidates is not None:
                among = {index: tuple((np.flatnonzero(may[mine]) + 1).tolist()) for index, may in plays.items()}
            own = [int(block.ego(np.array([at]))[0]), *members[mine].tolist()]
            yield at, candidate, own, among, bool(sure[place])

    # --- results

    def _results(
        self, rows: Block, block: TrackBlock, intervals: Sequence[IntervalVerdict], starts: _Starts
    ) -> Iterator[tuple[int, Result]]:
        """Intervals as results, with the recordings that they are of: by time, then the nearest first."""
        scenario, table = self.matcher.scenario, starts.table
        origins = np.array([each.origin for each in intervals], dtype=np.int64)
        told = order_by_distance(scenario, table, self.matcher.plans.always_twins, origins)
        order = sorted(
            range(len(told)),
            key=lambda n: (intervals[n].recording, intervals[n].start, intervals[n].end, told[n].place),
        )
        intervals, told = [intervals[n] for n in order], [told[n] for n in order]
        witnesses: Mapping[int, Mapping[str, WitnessValue]] = {}
        if self.proofs:
            witnesses = self._witnesses(rows, intervals, told, starts)
        open_ended = scenario.dynamics is None or not scenario.dynamics.terminates
        recordings = np.array([each.recording for each in intervals], dtype=np.int64)
        firsts = np.array([first for first, _ in block.runs], dtype=np.int64)[recordings]
        first = firsts + np.array([each.start for each in intervals], dtype=np.int64)
        last = firsts + np.array([each.end for each in intervals], dtype=np.int64)
        names = {each: block.name(each) for each in cast("list[int]", np.unique(recordings).tolist())}
        objects = [owner.name for owner in scenario.every_object]
        start_us, end_us = (cast("list[int]", block.times_us[labels].tolist()) for labels in (first, last))
        pairs = zip(intervals, told, strict=True)
        found = zip(pairs, block.frames(first), block.frames(last), start_us, end_us, strict=True)
        for (each, who), frame, last_frame, begins_us, ends_us in found:
            tracks = {**dict(each.binding[len(scenario.objects) :]), **who.tracks}
            roles = {objects[index]: _named(track) for index, track in sorted(tracks.items())}
            verdict: Verdict
            if each.truth == TRUE:
                verdict = Match(roles, {**witnesses.get(each.origin, {}), **each.witness})
            elif each.truth == UNKNOWN:
                start = starts.decided.get(each.origin)
                unsure = start.verdict.reason if start is not None and isinstance(start.verdict, Unknown) else ""
                verdict = Unknown(each.reason or unsure, Cause("over time"), roles)
            else:
                verdict = NoMatch(_cause(block.seconds(block.runs[each.recording][0] + each.end), each), roles)
            span = IntervalSpan(last_frame, ends_us, each.end - each.start + 1, open_ended)
            yield each.recording, Result(frame, names[each.recording], begins_us, verdict, interval=span)

    def _witnesses(
        self, rows: Block, intervals: Sequence[IntervalVerdict], told: Sequence[NearestRoles], starts: _Starts
    ) -> Mapping[int, Mapping[str, WitnessValue]]:
        """The witnesses of the initial scenes of intervals that match, by the numbers of their starts."""
        wanted = {each.origin: who for each, who in zip(intervals, told, strict=True) if each.truth == TRUE}
        verdicts: dict[int, Verdict] = {}
        rest: dict[int, list[int]] = {}
        for each, who in sorted(wanted.items()):
            known = starts.decided.get(each)
            if known is not None:
                same = known.found == who.members
                verdicts[each] = known.verdict if same else self._again(starts, each, who, known)
            else:
                rest.setdefault(int(starts.table.outcomes[each]), []).append(each)
        scenario = self.matcher.scenario
        others = [owner.index for owner in scenario.objects if owner.index != scenario.ego]
        among = {index: (number,) for number, index in enumerate(others, 1)}
        for outcome, numbers in rest.items():
            found = [
                make_start_label(scenario, starts.table.block, wanted[each].members, rows.map, self._relevant)
                for each in numbers
            ]
            labels = [(label, among) for label, _ in found]
            verdicts.update(zip(numbers, self._search_of(outcome).rest.match_all(labels), strict=True))
        return {number: each.witness for number, each in verdicts.items() if isinstance(each, Match)}

    def _again(self, starts: _Starts, number: int, who: NearestRoles, known: DecidedStart) -> Verdict:
        """The verdict of a start that the matcher has decided, with interchangeable objects in another order."""
        scenario, block = self.matcher.scenario, starts.table.block
        given = {
            scenario.objects[index].name: block.id(member)
            for index, member in who.members.items()
            if not block.is_ego(member)
        }
        return self._search_of(int(starts.table.outcomes[number])).matcher.match(known.label, fixed_roles=given)


def _objects_of(block: TrackBlock, labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """The label objects of labels, in order."""
    wanted = np.zeros(len(block) + 1, np.bool_)
    wanted[labels] = True
    return np.flatnonzero(wanted[block.label_of[: int(block.object_starts[-1])]])


def _named(track: TrackKey) -> str:
    """A track as results name it."""
    kind, name = track
    return "ego" if kind == "ego" else name.rpartition("\n")[2]


def _what(broken: Span | None, *, cut_off: bool) -> str:
    """What keeps a binding from matching, in a word."""
    if broken is None:
        return CUT_OFF if cut_off else "--min-duration"
    return " ".join(broken.text.split())


def _cause(seconds: float, interval: IntervalVerdict) -> Cause:
    """Why an interval that ends after some seconds of its recording does not match."""
    what = _what(interval.broken, cut_off=interval.cut_off)
    if interval.broken is not None:
        return Cause(what, f"does not hold on what ends at {seconds:.1f} s", interval.broken)
    if interval.cut_off:
        return Cause(what, f"at {seconds:.1f} s, before the program ends")
    return Cause(what, f"matches only up to {seconds:.1f} s")


def _undecided(block: TrackBlock, at: int, verdict: Unknown) -> Result:
    time_us, frame = int(block.times_us[at]), block.frame(at)
    name = block.name(int(block.recording_of[at]))
    return Result(frame, name, time_us, verdict, interval=IntervalSpan(frame, time_us, 1, open_ended=True))


def lost_recording(dataset: Dataset, rows: Block) -> DecidedRecordings:
    """The one result of a recording that kills every process that takes it."""
    with TrackBlock(dataset, rows.part, rows.runs) as block:
        lost = Unknown("crash", Cause("process", "every process that matched this recording died"))
        last = len(block) - 1
        span = IntervalSpan(block.frame(last), int(block.times_us[last]), len(block), open_ended=True)
        result = Result(block.frame(0), block.name(0), int(block.times_us[0]), lost, interval=span)
    return DecidedRecordings([result], Counter(recordings=1))
