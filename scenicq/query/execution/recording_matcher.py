"""The recordings of a block decided: starts from the labels that are left, then intervals, recording by recording."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import groupby

from scenicq.forest.groups import Condition
from scenicq.forest.scenario import Requirement, Scenario
from scenicq.match.explanation import Finding
from scenicq.match.matcher import Matcher
from scenicq.match.problem.candidates import Candidates
from scenicq.match.problem.constraints import describe_constraint
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown, Verdict
from scenicq.query.execution.results import IntervalSpan, Result
from scenicq.query.prefilter.executor import Block, Candidate
from scenicq.store.dataset import Dataset
from scenicq.store.labels import Label
from scenicq.store.tracks import RecordingTracks, TrackKey, TrackReader, track_of
from scenicq.temporal.intervals import Interval, IntervalMatcher, Start
from scenicq.temporal.start_columns import StartColumns
from scenicq.temporal.truth import TRUE, UNKNOWN, Truth

__all__ = ["DecidedRecordings", "RecordingMatcher", "lost_recording", "starts_of"]

CUT_OFF = "recording-ends"
"""The cause of what might have matched, had the recording or a track gone on."""


@dataclass(slots=True)
class DecidedRecordings:
    """What became of the recordings of a block; complete once the results are taken.

    Attributes:
        results: One for each interval, in order; of a binding without one, how far it came.
        counts: See `Funnel.over_time`.
        failed: What frames failed at that are not excluded by the prefilter, and are no starts.
    """

    results: list[Result] = field(default_factory=list[Result])
    counts: Counter[str] = field(default_factory=Counter[str])
    failed: Counter[str] = field(default_factory=Counter[str])


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
        options = self.matcher.options
        self._columns = StartColumns(self.matcher.scenario, options)
        self._rest = self.matcher
        if self._columns.by_role:
            self._rest = Matcher(self._columns.rest(), options, self.matcher.solver)

    def decide(self, block: Block, left: Iterable[Candidate]) -> DecidedRecordings:
        """Decide a block of whole recordings.

        Args:
            block: The block.
            left: Its labels that may be starts, in order.
        """
        found = DecidedRecordings()
        with ExitStack() as stack:
            reader: TrackReader | None = None
            rows: dict[str, tuple[int, int]] = {}
            for name, group in groupby(left, key=lambda each: each.label.recording):
                candidates = list(group)
                if reader is None:
                    reader = stack.enter_context(TrackReader(self.dataset, block.part))
                    names = reader.names([first for first, _ in block.runs])
                    rows = dict(zip(names, block.runs, strict=True))
                tracks = reader.read(*rows[name])
                starts = self._starts(tracks, candidates, found)
                self._recording(tracks, starts, found)
        found.counts["recordings"] += len(block.runs)
        return found

    def _starts(
        self, tracks: RecordingTracks, candidates: Iterable[Candidate], found: DecidedRecordings
    ) -> list[tuple[Candidate, list[Finding]]]:
        """How labels can be the start, those that can."""
        numbers = {frame: number for number, frame in enumerate(tracks.frames)}
        known: dict[tuple[int, TrackKey], list[tuple[Requirement, Truth]]] = {}
        starts: list[tuple[Candidate, list[Finding]]] = []
        for candidate in candidates:
            narrowed = self._narrowed(tracks, candidate, numbers[candidate.label.frame], known)
            if isinstance(narrowed, Requirement):
                found.failed[describe_constraint(self.matcher.scenario, Condition(narrowed, narrowed.condition))] += 1
                continue
            among, matcher = narrowed
            findings = list(matcher.findings(candidate.label, among=among))
            for each in findings:
                if isinstance(each.verdict, NoMatch):
                    found.failed[each.verdict.cause.what] += 1
            kept = [each for each in findings if not isinstance(each.verdict, NoMatch)]
            found.counts["starts"] += bool(kept)
            if kept:
                starts.append((candidate, kept))
        return starts

    def _narrowed(
        self,
        tracks: RecordingTracks,
        candidate: Candidate,
        sample: int,
        known: dict[tuple[int, TrackKey], list[tuple[Requirement, Truth]]],
    ) -> tuple[Candidates | None, Matcher] | Requirement:
        """Who may play whom, and who decides the rest; or the requirement that nobody satisfies."""
        label, scenario = candidate.label, self.matcher.scenario
        if not self._columns.by_role or not label.has_ego:
            return candidate.among, self.matcher
        among = dict(candidate.among or {})
        sure = True
        for role in self._columns.by_role:
            numbers = (0,) if role == scenario.ego else among.get(role, range(1, len(label.objects) + 1))
            kept: list[int] = []
            blamed: Requirement | None = None
            for number in numbers:
                key = track_of(label, label.objects[number - 1] if number else label.ego)
                if (role, key) not in known:
                    known[role, key] = self._columns.decide(tracks, role, key)
                broken = self._columns.excluded(known[role, key], sample)
                if broken is None:
                    kept.append(number)
                    sure = sure and all(truth[sample] == TRUE for _, truth in known[role, key])
                blamed = blamed or broken
            if not kept and blamed is not None:
                return blamed
            if role != scenario.ego:
                among[role] = tuple(kept)
        return among, self._rest if sure else self.matcher

    def _recording(
        self, tracks: RecordingTracks, starts: Iterable[tuple[Candidate, list[Finding]]], found: DecidedRecordings
    ) -> None:
        numbers = {frame: number for number, frame in enumerate(tracks.frames)}
        mine: list[Start] = []
        for candidate, findings in starts:
            sample = numbers[candidate.label.frame]
            for start in starts_of(self.matcher.scenario, candidate.label, sample, findings):
                if isinstance(start, Start):
                    mine.append(start)
                else:
                    found.results.append(_undecided(tracks, sample, start))
        intervals = self.intervals.intervals(tracks, mine)
        found.counts["bindings"] += len({start.binding for start in mine})
        found.counts["cut off"] += sum(each.cut_off for each in intervals)
        found.results += [self.result(tracks, each) for each in intervals]

    def result(self, tracks: RecordingTracks, interval: Interval) -> Result:
        """An interval as a result."""
        scenario = self.matcher.scenario
        roles = {scenario.objects[index].name: _named(track) for index, track in interval.binding}
        verdict: Verdict
        if interval.truth == TRUE:
            verdict = Match(roles, interval.witness)
        elif interval.truth == UNKNOWN:
            verdict = Unknown(interval.reason, Cause("over time"), roles)
        else:
            verdict = NoMatch(_cause(tracks, interval), roles)
        dynamics = scenario.dynamics
        span = IntervalSpan(
            tracks.frames[interval.end],
            int(tracks.times_us[interval.end]),
            interval.end - interval.start + 1,
            dynamics is None or not dynamics.terminates,
        )
        start = interval.start
        return Result(tracks.frames[start], tracks.name, int(tracks.times_us[start]), verdict, interval=span)


def starts_of(scenario: Scenario, label: Label, sample: int, findings: Iterable[Finding]) -> Iterator[Start | Unknown]:
    """The starts that a label makes; what is undecided without a whole correspondence stays as it is.

    Interchangeable objects take their tracks in one order in all labels.
    """
    things = (label.ego, *label.objects)
    for finding in findings:
        verdict = finding.verdict
        if isinstance(verdict, NoMatch):
            continue
        chosen = dict(finding.assignment)
        if isinstance(verdict, Match) and finding.search is not None and finding.plan is not None:
            chosen[scenario.ego] = finding.search.problem.ego
            tracks = {index: track_of(label, things[number]) for index, number in chosen.items()}
            for members in _classes(finding.plan.twins):
                ordered = sorted(tracks[index] for index in members)
                tracks.update(zip(sorted(members), ordered, strict=True))
        else:
            by_id = {thing.id: thing for thing in label.objects} | {"ego": label.ego}
            names = {thing.name: thing.index for thing in scenario.objects}
            whole = verdict.correspondence
            if len(whole) < len(scenario.objects):
                if isinstance(verdict, Unknown):
                    yield verdict
                continue
            tracks = {names[name]: track_of(label, by_id[id_]) for name, id_ in whole.items()}
        if len(set(tracks.values())) < len(tracks):
            continue  # a track that a label has twice
        yield Start(sample, tuple(sorted(tracks.items())), verdict, label, verdict.correspondence)


def _classes(twins: Mapping[int, int]) -> list[list[int]]:
    """Objects that are interchangeable with each other."""
    found: dict[int, list[int]] = {}
    first: dict[int, int] = {}
    for index, earlier in sorted(twins.items()):
        head = first.get(earlier, earlier)
        first[index] = head
        found.setdefault(head, [head]).append(index)
    return list(found.values())


def _named(track: TrackKey) -> str:
    """A track as results name it."""
    kind, name = track
    return "ego" if kind == "ego" else name.rpartition("\n")[2]


def _cause(tracks: RecordingTracks, interval: Interval) -> Cause:
    seconds = float(tracks.seconds[interval.end])
    if interval.cut_off:
        return Cause(CUT_OFF, f"at {seconds:.1f} s, before the program ends")
    if interval.broken is None:
        return Cause("--min-duration", f"matches only up to {seconds:.1f} s")
    what = " ".join(interval.broken.text.split())
    return Cause(what, f"does not hold on what ends at {seconds:.1f} s", interval.broken)


def _undecided(tracks: RecordingTracks, sample: int, verdict: Unknown) -> Result:
    time_us = int(tracks.times_us[sample])
    frame = tracks.frames[sample]
    return Result(frame, tracks.name, time_us, verdict, interval=IntervalSpan(frame, time_us, 1, open_ended=True))


def lost_recording(dataset: Dataset, block: Block) -> DecidedRecordings:
    """The one result of a recording that kills every process that takes it."""
    with TrackReader(dataset, block.part) as reader:
        tracks = reader.read(block.first, block.end)
    lost = Unknown("crash", Cause("process", "every process that matched this recording died"))
    span = IntervalSpan(tracks.frames[-1], int(tracks.times_us[-1]), len(tracks), open_ended=True)
    result = Result(tracks.frames[0], tracks.name, int(tracks.times_us[0]), lost, interval=span)
    return DecidedRecordings([result], Counter(recordings=1))
