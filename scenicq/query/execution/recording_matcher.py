"""The recordings of a block decided: the labels that are left side by side, then intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenicq.match.matcher import Matcher
from scenicq.match.problem.constraints import relevant_properties
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown, Verdict, WitnessValue
from scenicq.query.execution.recording_starts import DecidedStart, few_findings, label_of, start_table, starts_of
from scenicq.query.execution.results import IntervalSpan, Result
from scenicq.query.prefilter.executor import Block
from scenicq.query.prefilter.survivors import Candidate, CandidateRows
from scenicq.store.classes import class_matches
from scenicq.store.dataset import Dataset
from scenicq.store.labels import Label
from scenicq.store.track_block import TrackBlock
from scenicq.store.tracks import TrackKey
from scenicq.temporal.hidden_runs import Remembered
from scenicq.temporal.intervals import IntervalMatcher, IntervalVerdict
from scenicq.temporal.starts import RoleCandidates, StartSearch
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
    """

    results: list[Result] = field(default_factory=list[Result])
    counts: Counter[str] = field(default_factory=Counter[str])
    failed: Counter[str] = field(default_factory=Counter[str])


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


@dataclass(eq=False)
class RecordingMatcher:
    """What a process keeps between blocks.

    Attributes:
        dataset: The dataset.
        matcher: For the initial scene.
        intervals: For what follows.
    """

    dataset: Dataset
    matcher: Matcher
    intervals: IntervalMatcher

    def __post_init__(self) -> None:
        """Choose what is decided before labels are matched."""
        self._search = StartSearch(self.matcher)
        self._relevant = relevant_properties(self.matcher.scenario, self.matcher.options)

    def decide(self, rows: Block, left: Survivors) -> DecidedRecordings:
        """Decide a block of whole recordings.

        Args:
            rows: The block.
            left: Its labels that may be starts.
        """
        found = DecidedRecordings(counts=Counter(recordings=len(rows.runs)))
        if not len(left.labels):
            return found
        with TrackBlock(self.dataset, rows.part, rows.runs) as block:
            arrays, decided, undecided = self._starts(block, left, found)
            table = start_table(self.matcher.scenario, block, arrays, decided)
            by_number = dict(enumerate(decided, len(table) - len(decided)))

            def remember(number: int) -> Remembered:
                if number in by_number:
                    return by_number[number].label, by_number[number].correspondence
                members = {index: int(mine[number]) for index, mine in table.members.items()}
                return label_of(self.matcher.scenario, block, members, rows.map, self._relevant)

            intervals = self.intervals.intervals(table, remember)
            found.counts["starts"] += len(np.unique(table.labels)) + len(undecided)
            found.counts["bindings"] += len({(each.recording, each.binding) for each in intervals})
            found.counts["cut off"] += sum(each.cut_off for each in intervals)
            results = [(int(block.recording_of[at]), _undecided(block, at, verdict)) for at, verdict in undecided]
            results += self._results(block, intervals, by_number, remember)
            found.results += [result for _, result in sorted(results, key=lambda each: each[0])]
        return found

    # --- starts

    def _starts(
        self, block: TrackBlock, left: Survivors, found: DecidedRecordings
    ) -> tuple[Mapping[int, NDArray[np.int64]], list[DecidedStart], list[tuple[int, Unknown]]]:
        """Starts that arrays have, those that the matcher has decided, and the labels that stay undecided."""
        labels = left.labels - block.first_label
        arrays: Mapping[int, NDArray[np.int64]] = {}
        candidates = self._candidates(block, labels, left)
        sure = np.ones(len(labels), np.bool_)
        codes, classes = block.categories()
        own: list[int] = np.unique(codes[block.ego(labels)]).tolist()
        if candidates is not None and all(classes[code] for code in own):
            starts = self._search.decide(block, candidates)
            arrays, candidates, sure = starts.members, starts.left, starts.sure
            labels = candidates.labels
            found.failed.update(starts.failed)
        decided: list[DecidedStart] = []
        undecided: list[tuple[int, Unknown]] = []
        known_starts: Counter[int] = Counter()
        read = left.read(labels + block.first_label) if len(labels) else iter(())
        for at, candidate, members, among, known in self._asked(block, left, labels, candidates, sure, read):
            matcher = self._search.rest if known else self.matcher
            label = candidate.label
            recording = int(block.recording_of[at])
            findings = few_findings(matcher, label, known_starts[recording], among=among)
            known_starts[recording] += sum(isinstance(each.verdict, Match) for each in findings)
            for each in findings:
                if isinstance(each.verdict, NoMatch):
                    found.failed[each.verdict.cause.what] += 1
            for start in starts_of(self.matcher.scenario, block, label, members, findings):
                if isinstance(start, Unknown):
                    undecided.append((at, start))
                else:
                    decided.append(start)
        return arrays, decided, undecided

    def _candidates(self, block: TrackBlock, labels: NDArray[np.int64], left: Survivors) -> RoleCandidates | None:
        """Who may play whom, if that is a matter of the label's own ego."""
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
        self, block: TrackBlock, left: Survivors, labels: NDArray[np.int64], candidates: RoleCandidates | None,
        sure: NDArray[np.bool_], read: Iterator[Candidate],
    ) -> Iterator[tuple[int, Candidate, list[int], Mapping[int, tuple[int, ...]] | None, bool]]:  # fmt: skip
        """Labels for the matcher, with their members, who may play whom, and whether plain requirements hold."""
        members = _objects_of(block, labels) if candidates is None else candidates.members
        ends = np.searchsorted(block.label_of[members], np.append(labels, len(block))).tolist()
        for place, (at, candidate) in enumerate(zip(labels.tolist(), read, strict=True)):
            mine = slice(ends[place], ends[place + 1])
            among: Mapping[int, tuple[int, ...]] | None = candidate.among
            if candidates is not None:
                among = {
                    index: tuple((np.flatnonzero(may[mine]) + 1).tolist()) for index, may in candidates.may.items()
                }
            own = [int(block.ego(np.array([at]))[0]), *members[mine].tolist()]
            yield at, candidate, own, among, bool(sure[place])

    # --- results

    def _results(
        self, block: TrackBlock, intervals: Sequence[IntervalVerdict], decided: Mapping[int, DecidedStart],
        remember: Callable[[int], Remembered],
    ) -> Iterator[tuple[int, Result]]:  # fmt: skip
        """Intervals as results, with the recordings that they are of."""
        witnesses = self._witnesses(intervals, decided, remember)
        for each in intervals:
            start = decided.get(each.origin)
            reason = start.verdict.reason if start is not None and isinstance(start.verdict, Unknown) else ""
            yield each.recording, self._result(block, each, witnesses.get(each.origin, {}), each.reason or reason)

    def _witnesses(
        self, intervals: Sequence[IntervalVerdict], decided: Mapping[int, DecidedStart],
        remember: Callable[[int], Remembered],
    ) -> Mapping[int, Mapping[str, WitnessValue]]:  # fmt: skip
        """The witnesses of the initial scenes of intervals that match, by the numbers of their starts."""
        wanted = sorted({each.origin for each in intervals if each.truth == TRUE})
        verdicts: dict[int, Verdict] = {each: decided[each].verdict for each in wanted if each in decided}
        rest = [each for each in wanted if each not in decided]
        scenario = self.matcher.scenario
        others = [owner.index for owner in scenario.objects if owner.index != scenario.ego]
        among = {index: (number,) for number, index in enumerate(others, 1)}
        labels: list[tuple[Label, Mapping[int, tuple[int, ...]] | None]] = [(remember(each)[0], among) for each in rest]
        verdicts.update(zip(rest, self._search.rest.match_all(labels), strict=True))
        return {number: each.witness for number, each in verdicts.items() if isinstance(each, Match)}

    def _result(
        self, block: TrackBlock, interval: IntervalVerdict, witness: Mapping[str, WitnessValue], reason: str
    ) -> Result:
        """An interval as a result."""
        scenario = self.matcher.scenario
        roles = {scenario.objects[index].name: _named(track) for index, track in interval.binding}
        first, _ = block.runs[interval.recording]
        start, end = first + interval.start, first + interval.end
        verdict: Verdict
        if interval.truth == TRUE:
            verdict = Match(roles, {**witness, **interval.witness})
        elif interval.truth == UNKNOWN:
            verdict = Unknown(reason, Cause("over time"), roles)
        else:
            verdict = NoMatch(_cause(block.seconds(end), interval), roles)
        dynamics = scenario.dynamics
        open_ended = dynamics is None or not dynamics.terminates
        span = IntervalSpan(block.frame(end), int(block.times_us[end]), end - start + 1, open_ended)
        name = block.name(interval.recording)
        return Result(block.frame(start), name, int(block.times_us[start]), verdict, interval=span)


def _objects_of(block: TrackBlock, labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """The label objects of labels, in order."""
    wanted = np.zeros(len(block) + 1, np.bool_)
    wanted[labels] = True
    return np.flatnonzero(wanted[block.label_of[: int(block.object_starts[-1])]])


def _named(track: TrackKey) -> str:
    """A track as results name it."""
    kind, name = track
    return "ego" if kind == "ego" else name.rpartition("\n")[2]


def _cause(seconds: float, interval: IntervalVerdict) -> Cause:
    """Why an interval that ends after some seconds of its recording does not match."""
    if interval.cut_off:
        return Cause(CUT_OFF, f"at {seconds:.1f} s, before the program ends")
    if interval.broken is None:
        return Cause("--min-duration", f"matches only up to {seconds:.1f} s")
    what = " ".join(interval.broken.text.split())
    return Cause(what, f"does not hold on what ends at {seconds:.1f} s", interval.broken)


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
