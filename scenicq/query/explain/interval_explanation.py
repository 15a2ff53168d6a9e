"""Why a recording matches a dynamic program, or how far the binding that comes closest gets and what breaks it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from scenicq.errors import Diagnostic, render
from scenicq.forest.scenario import Scenario
from scenicq.limits import LIMITS
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown, Verdict
from scenicq.query.execution.interval_frames import locate
from scenicq.query.execution.recording_matcher import CUT_OFF
from scenicq.query.execution.recording_starts import DecidedStart, decided_starts, find_starts, start_table
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query
from scenicq.query.explain.bands import Band, bands_of, columns_of, conditions_over, show_bands
from scenicq.query.explain.changes import longest_interval, shift_comparison
from scenicq.query.explain.frame_explanation import explain, show_explanation
from scenicq.query.explain.interval_changes import Shift, least_changes
from scenicq.query.explain.mode_explanation import run_modes
from scenicq.query.explain.moments import frame_time, intervals_around
from scenicq.smt.answer import Solver
from scenicq.store.labels import Label
from scenicq.store.track_block import TrackBlock
from scenicq.store.tracks import RecordingTracks, TrackKey, TrackReader
from scenicq.temporal.intervals import IntervalMatcher, IntervalVerdict
from scenicq.temporal.starts import StartMatchers
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN

__all__ = ["IntervalExplanation", "changes_of", "explain_beginning", "explain_recording", "locate_interval"]


_AROUND_SHOWN = 5
"""Intervals around a frame that are named."""

_Start = tuple[DecidedStart, int]
"""A start, and the number of the outcome of the choices over time."""


@dataclass(frozen=True, slots=True)
class IntervalExplanation:
    """What became of a recording.

    Attributes:
        tracks: The recording.
        interval: The match, else what came furthest; None where no frame matches the initial scene.
        roles: The track of each object.
        bands: Over the interval.
        activities: What behaviors, monitors and scenarios do from when to when, a line for each.
        asked: What the behavior that has rejected the run asked for, and what its object has shown.
        broken_s: When a behavior or monitor has rejected the run; None where none has.
        changes: What one number of the program would have to be for the recording to match; each was tried.
        failed: What frames failed at that do not match the initial scene.
        example: One of the frames that failed at what the fewest did.
        undecided: How many frames are unknown to match the initial scene, by the reason.
        least_s: How many seconds an interval of a program about one instant was to have; None of other programs.
    """

    tracks: RecordingTracks
    interval: IntervalVerdict | None
    roles: tuple[tuple[str, str], ...] = ()
    bands: tuple[Band, ...] = ()
    activities: tuple[str, ...] = ()
    asked: tuple[str, ...] = ()
    broken_s: float | None = None
    changes: tuple[str, ...] = ()
    failed: Counter[str] | None = None
    example: str = ""
    undecided: Counter[str] = field(default_factory=Counter[str])
    least_s: float | None = None

    @property
    def is_unknown(self) -> bool:
        """Whether it may match: an interval is unknown, or it is unknown whether one begins at a frame."""
        if self.matches:
            return False
        return bool(self.undecided) or (self.interval is not None and self.interval.truth != FALSE)

    @property
    def samples(self) -> int:
        """How many samples the interval has."""
        return 0 if self.interval is None else self.interval.end - self.interval.start + 1

    @property
    def matches(self) -> bool:
        """Whether it matches."""
        return self.interval is not None and self.interval.truth == TRUE

    def text(self) -> str:
        """The explanation for a person."""
        tracks, interval = self.tracks, self.interval
        if interval is None:
            counted = (self.failed or Counter()).most_common()
            rows = [f"  {count:>6,}  {what}" for what, count in counted]
            hint = [f"  = hint: `scenicq explain` with the frame {self.example} says how far that one is"]
            if not counted:
                return "\n".join([f"no frame of {tracks.name} surely matches the initial scene", *self._undecided()])
            head = f"no frame of {tracks.name} matches the initial scene; they fail at"
            return "\n".join([head, *rows, *self._undecided(), *(hint if self.example else ())])
        first, last = float(tracks.seconds[interval.start]), float(tracks.seconds[interval.end])
        frames = interval.end - interval.start + 1
        said = "matches" if interval.truth == TRUE else "does not match" if interval.truth == FALSE else "is unknown"
        if interval.reason:
            said += f" ({interval.reason})"
        lines = [
            f"recording {tracks.name} {said} from {first:.1f} s to {last:.1f} s "
            f"({frames} {'frame' if frames == 1 else 'frames'} from {tracks.frames[interval.start]})",
            f"{'' if self.matches else 'closest '}correspondence: {', '.join(f'{r} = {t}' for r, t in self.roles)}",
        ]
        if interval.cut_off:
            lines.append(f"cut off: the recording or a track ends at {last:.1f} s, before the program does")
            lines += [f"  = {each}" for each in self.changes if interval.broken is None]
        if self.least_s is not None and interval.truth == FALSE:
            lines.append(
                f"each of these frames matches, for {last - first:.1f} s; --min-duration asks for {self.least_s:g} s"
            )
        lines += self._undecided() if not self.matches else ()
        lines += ["", *self._broken(interval)]
        if self.activities:
            lines += [*self.activities, ""]
        return "\n".join([*lines, *show_bands(self.bands)]).rstrip()

    def _undecided(self) -> list[str]:
        """How many frames are unknown to match the initial scene."""
        return [
            f"  {count:>6,}  {'is' if count == 1 else 'are'} unknown: {reason}"
            for reason, count in self.undecided.most_common()
        ]

    def _broken(self, interval: IntervalVerdict) -> list[str]:
        """The requirement that is broken, where, when, and by how much."""
        if interval.broken is None:
            return []
        told = Diagnostic(
            "frame-excluded",
            "this does not hold",
            interval.broken,
            f"broken {self._when(interval)}",
            severity="excluded",
        )
        hints = [f"  = {each}" for each in (*self.asked, *self._margins(interval), *self.changes)]
        return [render(told), *hints, ""]

    def _when(self, interval: IntervalVerdict) -> str:
        if self.broken_s is not None:
            return f"at {self.broken_s:.1f} s"
        last = float(self.tracks.seconds[interval.end])
        mine = next((band for band in self.bands if band.is_requirement and band.span == interval.broken), None)
        wrong = [place for place, value in enumerate(mine.values) if value == FALSE] if mine is not None else []
        seconds = float(self.tracks.seconds[interval.start + wrong[-1]]) if wrong else last
        return f"at {seconds:.1f} s" if wrong else f"by {last:.1f} s"

    def _margins(self, interval: IntervalVerdict) -> list[str]:
        """For each comparison inside the broken requirement how close it comes to the other outcome."""
        broken = interval.broken
        assert broken is not None
        found: list[str] = []
        for band in self.bands:
            inside = band.span is not None and broken.start <= band.span.start and band.span.end <= broken.end
            if band.is_requirement or not inside or not band.sides:
                continue
            known = [each for each in band.sides if not np.isnan(each).any()]
            if known:
                left, right = min(known, key=lambda each: abs(each[0] - each[1]))
                widest = max(known, key=lambda each: abs(each[0] - each[1]))
                found.append(
                    f"`{band.what}`: off by {abs(left - right):.3g} at the nearest ({left:.3g} against {right:.3g}), "
                    f"by {abs(widest[0] - widest[1]):.3g} at the furthest"
                )
        return found


def explain_recording(query: Query, solver: Solver, name: str, begins: int | float | None) -> IntervalExplanation:
    """Explain a recording.

    Args:
        query: A query over time.
        solver: Decides what is not decided otherwise.
        name: Name of the recording.
        begins: Where the interval shall begin: a timestamp in microseconds, or, as a float, the seconds from where the
            recording begins, to half the time between two frames; anywhere by default.

    Raises:
        DataError: option-invalid: there is no such recording, or no frame at that time.
    """
    part, first, end = locate(query.dataset, name)
    labels: list[Label] = list(query.dataset.labels_at(part, first, end))
    scenario, _ = query.compile(labels[0].map)
    found = [
        _explain_variant(query, solver, each, name, begins, labels)
        for each in scenario.variants or (scenario,)
    ]  # fmt: skip
    # the surest, then what came furthest
    return max(found, key=lambda each: (each.matches, each.is_unknown, each.samples))


def _explain_variant(
    query: Query, solver: Solver, scenario: Scenario, name: str, begins: int | float | None, labels: Sequence[Label]
) -> IntervalExplanation:
    """Explain a recording by one variant of a program; arguments as of `explain_recording`."""
    part, first, end = locate(query.dataset, name)
    with TrackReader(query.dataset, part) as reader:
        tracks = reader.read(first, end)
    intervals = IntervalMatcher(scenario, query.options.match, query.options.time, solver)
    matchers = StartMatchers(Matcher(scenario, query.options.match, solver), intervals.outcomes)
    # an interval of a program about one instant is made of frames that all match
    dynamic = scenario.dynamics is not None
    time_us = None if begins is None else frame_time(name, tracks.times_us.tolist(), begins)
    failed: Counter[str] = Counter()
    undecided: Counter[str] = Counter()
    examples: dict[str, str] = {}
    with TrackBlock(query.dataset, part, [(first, end)]) as block:
        starts: list[_Start] = []
        known: Counter[str] = Counter()
        for sample, label in enumerate(labels):
            if time_us is not None and label.timestamp_us != time_us and (dynamic or label.timestamp_us < time_us):
                continue
            members = [
                int(block.ego(np.array([sample]))[0]),
                *range(*block.object_starts[sample : sample + 2].tolist()),
            ]
            causes: list[str] = []
            unknown: list[str] = []
            before = len(starts)
            for outcome in range(len(intervals.outcomes)):
                findings = find_starts(matchers[outcome], label, known)
                found = [*decided_starts(scenario, block, label, members, findings)]
                starts += [(each, outcome) for each in found if isinstance(each, DecidedStart)]
                unknown = [each.reason for each in found if isinstance(each, Unknown)] or unknown
                causes += [each.verdict.cause.what for each in findings if not isinstance(each.verdict, Match)]
            undecided.update(unknown[:1])
            if len(starts) == before and not unknown:
                what = causes[0] if causes else "tracks"
                failed[what] += 1
                examples.setdefault(what, label.frame)
        results = _intervals(intervals, scenario, block, starts)
        if time_us is not None:
            results = [each for each in results if int(tracks.times_us[each.start]) == time_us]
        # what is cut off is looked at where no run comes to its end
        whole = starts
        for _ in range(LIMITS.cut_off_rounds):
            cut = {each.binding: each.start for each in results if each.cut_off}
            whole = [each for each in whole if not _is_after(block, each, cut)]
            if not cut or not whole:
                break
            results = _intervals(intervals, scenario, block, whole)
    if not results:
        rarest = min(failed, key=lambda what: failed[what], default="")
        example = examples.get(rarest, "")
        return IntervalExplanation(tracks, None, failed=failed, example=example, undecided=undecided)
    best = max(results, key=lambda each: (each.truth, each.cut_off, each.end - each.start))
    roles = tuple((scenario.every_object[index].name, track[1] or "ego") for index, track in best.binding)
    # one of several variants is not tried again by itself
    tried = () if query.compiled_map(labels[0].map).scenario.variants else changes_of(scenario, tracks, best)
    shifts = [shift_comparison(each, best.broken) for each in tried[: LIMITS.ranked_numbers]]
    changes = tuple(each.text for each in shifts if longest_interval(query, name, labels[0].map, each) is not None)
    over = conditions_over(scenario, tracks, best)
    bands = bands_of(scenario, over)
    least_s = None if dynamic else query.options.time.min_duration_s
    modes = run_modes(scenario, tracks, best, over)
    activities, asked, broken_s = (), (), None
    if modes is not None:
        assert scenario.dynamics is not None
        spans = [each.span for each in scenario.dynamics.processes]
        if best.broken in spans:
            broken_s = modes.ends(spans.index(best.broken))
            asked = tuple(modes.broken(spans.index(best.broken)))
        activities = tuple(modes.lines())
    return IntervalExplanation(
        tracks, best, roles, bands, activities, asked, broken_s, changes, undecided=undecided, least_s=least_s
    )


def explain_beginning(query: Query, solver: Solver, label: Label) -> tuple[Verdict, str]:
    """Explain whether an interval begins at a frame, and name those that the frame lies in.

    Args:
        query: A query over time.
        solver: Decides what is not decided otherwise.
        label: The frame.

    Returns:
        What became of the interval that begins there, and the explanation for a person.
    """
    if query.compiled_map(label.map).scenario.dynamics is None:
        return _explain_within(query, solver, label)
    begun = explain_recording(query, solver, label.recording, label.timestamp_us)
    verdict: Verdict
    if begun.interval is None:
        # without a start, the frame itself is what keeps an interval from beginning
        scene = explain(Matcher(query.compile(label.map)[0], query.options.match, solver), label)
        verdict = scene.verdict if isinstance(scene.verdict, Unknown) else NoMatch(Cause("initial scene"))
        text = show_explanation(scene)
        if isinstance(scene.verdict, Match):
            text = f"no interval begins at this frame: its objects have no tracks; of the initial scene:\n{text}"
    else:
        verdict = Match({}, {}) if begun.matches else NoMatch(Cause("over time"))
        verdict = Unknown("", Cause("over time")) if begun.is_unknown else verdict
        text = begun.text()
    others = [each for each in intervals_around(query, label) if each.timestamp_us != label.timestamp_us]
    lines = _listed(others)
    head = "the frame lies in intervals that begin before it:" if lines else ""
    return verdict, "\n".join([text, *(["", head, *lines] if lines else ())])


def _explain_within(query: Query, solver: Solver, label: Label) -> tuple[Verdict, str]:
    """Explain whether a frame lies in an interval of a program about one instant, which has no beginning of its own."""
    scene = explain(Matcher(query.compile(label.map)[0], query.options.match, solver), label)
    around = intervals_around(query, label)
    text = show_explanation(scene)
    if around:
        text += "\n\n" + "\n".join(["the frame lies in these intervals:", *_listed(around)])
        return around[0].verdict, text
    if not isinstance(scene.verdict, Match):
        return scene.verdict, text
    least_s = query.options.time.min_duration_s or 0.0
    told = (
        f"it lies in no interval of {least_s:g} s in which every frame matches with the same objects (--min-duration)"
    )
    text += f"\n\n{told}"
    return NoMatch(Cause("--min-duration")), text


def _listed(intervals: Sequence[Result]) -> list[str]:
    """Intervals, one a line."""
    lines = [_around(each) for each in intervals[:_AROUND_SHOWN]]
    return lines if len(intervals) <= len(lines) else [*lines, f"  and {len(intervals) - len(lines)} more"]


def _around(result: Result) -> str:
    """An interval in a line."""
    assert result.interval is not None
    verdict = result.verdict
    roles = verdict.partial if isinstance(verdict, NoMatch) else verdict.correspondence
    told = "matches" if isinstance(verdict, Match) else f"unknown ({verdict.reason})" if isinstance(
        verdict, Unknown) else "does not match"  # fmt: skip
    seconds = (result.interval.end_us - result.timestamp_us) / 1e6
    played = ", ".join(f"{role} = {track}" for role, track in roles.items())
    return f"  {result.recording}@{result.timestamp_us}: {told}, {seconds:.1f} s, {played}"


def changes_of(
    scenario: Scenario, tracks: RecordingTracks, interval: IntervalVerdict, *, quick: bool = False
) -> tuple[Shift, ...]:
    """What would let an interval through: the requirement that is broken hold, or the program end; the least first.

    Args:
        scenario: The scenario.
        tracks: The recording.
        interval: What does not match.
        quick: As of `least_changes`.
    """
    dynamics = scenario.dynamics
    if dynamics is None or interval.truth == TRUE:
        return ()
    columns = columns_of(scenario, tracks, interval)
    changes = [
        change
        for each in dynamics.requirements
        if each.span == interval.broken
        for change in least_changes(columns, each.formula, dynamics.conditions, goes_on=interval.cut_off, quick=quick)
    ]
    if interval.cut_off and interval.broken is None:
        for each in dynamics.terminations:
            if each.condition is None:
                continue
            changes += least_changes(columns, each.condition, dynamics.conditions, ends=True, quick=quick)
    return tuple(sorted(changes, key=lambda each: abs(each.amount)))


def _intervals(
    matcher: IntervalMatcher, scenario: Scenario, block: TrackBlock, starts: Sequence[_Start]
) -> list[IntervalVerdict]:
    table = start_table(scenario, block, {}, [start for start, _ in starts])
    table = replace(table, outcomes=np.array([outcome for _, outcome in starts], dtype=np.int64))
    return matcher.intervals(
        table, lambda number: (starts[number][0].label, starts[number][0].correspondence)
    ).intervals


def _is_after(block: TrackBlock, start: _Start, samples: Mapping[tuple[tuple[int, TrackKey], ...], int]) -> bool:
    """Whether a start is at the sample that its binding has among some, or after it."""
    members = start[0].members
    binding = tuple((index, block.key(member)) for index, member in sorted(members.items()))
    return binding in samples and int(block.label_of[next(iter(members.values()))]) >= samples[binding]


def locate_interval(query: Query, result: Result) -> tuple[Scenario, RecordingTracks, IntervalVerdict]:
    """Find the interval of a result: the scenario over its map, its recording, and the roles and samples in it.

    Raises:
        ValueError: The result is of a frame.
        ScenarioError: The program is wrong.
    """
    if result.interval is None:
        raise ValueError("the result is of a frame")
    part, first, end = locate(query.dataset, result.recording)
    label = next(query.dataset.labels_at(part, first, first + 1))
    scenario = query.compiled_map(label.map).scenario
    with TrackReader(query.dataset, part) as reader:
        tracks = reader.read(first, end)
    verdict = result.verdict
    roles = verdict.partial if isinstance(verdict, NoMatch) else verdict.correspondence
    alike = (each for each in scenario.variants if {owner.name for owner in each.every_object} == set(roles))
    scenario = next(alike, scenario)
    indices = {owner.name: owner.index for owner in scenario.every_object}
    binding = tuple((indices[name], _key(tracks, track)) for name, track in roles.items())
    start, last = tracks.frames.index(result.frame), tracks.frames.index(result.interval.last)
    truth = int(TRUE if isinstance(verdict, Match) else FALSE if isinstance(verdict, NoMatch) else UNKNOWN)
    if not isinstance(verdict, NoMatch):
        return scenario, tracks, IntervalVerdict(start, last, truth, binding)
    cause = verdict.cause
    cut_off = cause.what == CUT_OFF
    return scenario, tracks, IntervalVerdict(start, last, truth, binding, broken=cause.span, cut_off=cut_off)


def _key(tracks: RecordingTracks, name: str) -> TrackKey:
    """The track that a result names."""
    return ("ego", "") if name == "ego" else tracks.key(name)
