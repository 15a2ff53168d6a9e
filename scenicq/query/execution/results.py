"""Results of a query, and the funnel that says where the other frames went."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

from msgspec import Struct

from scenicq.errors import Diagnostic
from scenicq.match.verdict import Match, NoMatch, Unknown, Verdict

__all__ = [
    "CarriedValue",
    "Funnel",
    "IntervalSpan",
    "LogDensity",
    "ModeRecord",
    "ObjectLanes",
    "ProgramPlace",
    "RecordedCell",
    "Result",
    "Sample",
    "SelectionCounts",
    "limit_matches",
]

RecordedCell = float | bool | str | tuple[float, float] | None
"""A recorded value: a number, a truth value, a text, a vector; None where there is none."""


@dataclass(frozen=True, slots=True)
class IntervalSpan:
    """How far an interval goes on from its first frame.

    Attributes:
        last: Its last frame.
        end_us: The timestamp of that.
        count: How many frames it has.
        open_ended: Whether the program does not say when it ends.
    """

    last: str
    end_us: int
    count: int
    open_ended: bool


@dataclass(frozen=True, slots=True)
class LogDensity:
    """How typical a label is of the program.

    Attributes:
        log: Natural logarithm of the density with which the program generates what the label observes, in units of
            1 / (metres and radians), up to a constant of program and map; None where it is not known.
        error: Standard error of it.
        fixed: Features that the program fixes by an equality, which have no density and count nothing.
        reason: Why it is not known.
        log_weight: Logarithm of how much a frame counts where the frames that match are to be spread as the program
            spreads its scenes; over the results of a map weights are 1 in the mean. None where it is not known.
    """

    log: float | None
    error: float = 0.0
    fixed: tuple[str, ...] = ()
    reason: str = ""
    log_weight: float | None = None


@dataclass(frozen=True, slots=True)
class CarriedValue:
    """What a result carries of a value that the program records.

    Attributes:
        values: One, or of an interval one for each of its samples.
        series: Whether the program asks for it at each sample.
        lacking: At how many of these samples there is none, by the reason.
    """

    values: tuple[RecordedCell, ...]
    series: bool
    lacking: Mapping[str, int] = field(default_factory=dict[str, int])


@dataclass(frozen=True, slots=True)
class ObjectLanes:
    """In which lanes a label object stands.

    Attributes:
        own: The lanes that are its own.
        others: Those in which it lies, too.
    """

    own: tuple[str, ...] = ()
    others: tuple[str, ...] = ()


class ProgramPlace(Struct, frozen=True):
    """Something that the program says.

    Attributes:
        what: What.
        place: `file:line:column`.
    """

    what: str
    place: str


class ModeRecord(Struct, frozen=True):
    """What a role, a monitor or a scenario does from when to when.

    Attributes:
        kind: `behavior`, `monitor` or `scenario`.
        of: The role, the monitor as it is required, or the scenario that runs.
        mode: The calls within which something is done, the outermost first, and what is done: an action, a behavior
            of the libraries, a `wait`; of a scenario its own call last. Nothing where that is not known.
        start_us, end_us: Timestamps of the sample at which it begins, and of that at which it is over, or the last one.
        frames: At how many samples it goes on.
    """

    kind: str
    of: str
    mode: list[ProgramPlace]
    start_us: int
    end_us: int
    frames: int


@dataclass(frozen=True, slots=True)
class Result:
    """The verdict on one frame, or on an interval of a recording.

    Attributes:
        frame, recording, timestamp_us: Which frame; the first of an interval.
        verdict: The verdict. That on an interval names tracks.
        sensors: Path of the sensor file of each channel; empty for frames that the prefilter excluded.
        interval: How far the interval goes on; None for a frame.
        density: How typical it is, where that was asked for.
        recorded: What the program records of a match, by name; None where nobody asks for it.
        lanes: In which lanes the roles of a match stand whose lanes the program asks for, by name; of an interval at
            its first frame. None where it asks for none.
        timeline: What roles, monitors and scenarios of a match do from when to when, role by role, in order of time.
            None where nobody asks for it, or the program says nothing of the kind.
    """

    frame: str
    recording: str
    timestamp_us: int
    verdict: Verdict
    sensors: Mapping[str, str] = field(default_factory=dict[str, str])
    interval: IntervalSpan | None = None
    density: LogDensity | None = None
    recorded: Mapping[str, CarriedValue] | None = None
    lanes: Mapping[str, ObjectLanes] | None = None
    timeline: tuple[ModeRecord, ...] | None = None

    def __reduce__(self) -> tuple[type[Result], tuple[Any, ...]]:
        """Pickled as a call, which takes half the time; densities are computed where results arrive."""
        told = (self.frame, self.recording, self.timestamp_us, self.verdict, self.sensors, self.interval)
        more = self.recorded, self.lanes, self.timeline
        return Result, told if more == (None, None, None) else (*told, None, *more)


@dataclass(frozen=True, slots=True)
class Sample:
    """What a sample of matches was drawn from.

    Attributes:
        shown: How many matches are in it.
        of: How many there were.
        unknown: How many frames or intervals were undecided, by the reason: none of them is in it.
    """

    shown: int
    of: int
    unknown: Counter[str]


@dataclass(frozen=True, slots=True)
class SelectionCounts:
    """Which matches were chosen by what they carry.

    Attributes:
        where: The condition; "" where there is none.
        sort: What they are ordered by; "" for nothing.
        shown: How many there are.
        others, unclear: How many are left out as they do not meet the condition, or nobody knows.
        beyond: How many are left out as they come behind the limit of an order.
        limit: The limit; None where there is none.
    """

    where: str
    sort: str
    shown: int
    others: int
    unclear: int
    beyond: int
    limit: int | None = None

    def after(self, before: SelectionCounts | None) -> SelectionCounts:
        """What both have chosen, one out of what the other has left."""
        if before is None:
            return self
        where = f"({before.where}) and ({self.where})" if before.where and self.where else before.where or self.where
        return SelectionCounts(
            where, self.sort or before.sort, self.shown, before.others + self.others, before.unclear + self.unclear,
            before.beyond + self.beyond, before.limit,
        )  # fmt: skip

    @property
    def left_out(self) -> int:
        """How many are left out."""
        return self.others + self.unclear + self.beyond


@dataclass(slots=True)
class Funnel:
    """How many frames are left after each step, and what the others failed at first.

    Attributes:
        frames: Frames looked at.
        candidates: Left after the prefilter.
        with_roles: Frames among those with a label object of the right class for every role.
        matches, unknowns: Verdicts.
        excluded: How many frames failed first at which feature or requirement.
        reasons: Why frames are unknown.
        over_time: For a query over time: "recordings" looked at, "starts" (frames that match the initial scene),
            "bindings" that these make, and bindings "cut off" because the recording or a track ends before the program
            does. Matches, unknowns and reasons are then those of intervals.
        broken: For a query over time: how many bindings without a match broke which requirement.
        unrecorded: How often each recorded value is null, by the reason: `gap: not observed`.
        missing: Frames of the dataset in which a property that the program sets is missing, although others have it.
        warnings: What the user should know, such as a map that the program does not fit.
        cut: Whether the time was over before all frames were decided.
        limited: The match with which a limit ended the query; None where none did.
        sample: What the results were drawn from; None where all are shown.
        chosen: Which matches were chosen by what they carry; None where that was not asked for.
    """

    frames: int = 0
    candidates: int = 0
    with_roles: int = 0
    matches: int = 0
    unknowns: int = 0
    excluded: Counter[str] = field(default_factory=Counter[str])
    reasons: Counter[str] = field(default_factory=Counter[str])
    over_time: Counter[str] = field(default_factory=Counter[str])
    broken: Counter[str] = field(default_factory=Counter[str])
    unrecorded: Counter[str] = field(default_factory=Counter[str])
    missing: dict[str, int] = field(default_factory=dict[str, int])
    warnings: list[Diagnostic] = field(default_factory=list[Diagnostic])
    cut: bool = False
    limited: Result | None = None
    sample: Sample | None = None
    chosen: SelectionCounts | None = None

    def add(self, other: Funnel) -> None:
        """Count in what was found elsewhere."""
        self.frames += other.frames
        self.candidates += other.candidates
        self.with_roles += other.with_roles
        self.matches += other.matches
        self.unknowns += other.unknowns
        self.excluded.update(other.excluded)
        self.reasons.update(other.reasons)
        self.over_time.update(other.over_time)
        self.broken.update(other.broken)
        self.unrecorded.update(other.unrecorded)
        self.missing.update(other.missing)
        self.cut = self.cut or other.cut
        self.warnings += [warning for warning in other.warnings if warning not in self.warnings]

    def exclude(self, what: str, frames: int = 1) -> None:
        """Count frames that the prefilter excludes."""
        self.frames += frames
        self.excluded[what] += frames

    def count_recorded(self, result: Result) -> None:
        """Count what is null of what a result carries."""
        for name, each in (result.recorded or {}).items():
            self.unrecorded.update({f"{name}: {reason}": number for reason, number in each.lacking.items()})

    def count_interval(self, verdict: Verdict) -> None:
        """Count a verdict on an interval."""
        self._tally(verdict, self.broken)

    def count(self, verdict: Verdict) -> None:
        """Count a verdict of the matcher."""
        self.frames += 1
        self.candidates += 1
        if isinstance(verdict, Match):
            self.with_roles += 1
            self.matches += 1
            return
        self.with_roles += not (isinstance(verdict, NoMatch) and verdict.cause.what.endswith(".class"))
        self._tally(verdict, self.excluded)

    def _tally(self, verdict: Verdict, failed: Counter[str]) -> None:
        match verdict:
            case Match():
                self.matches += 1
            case Unknown():
                self.unknowns += 1
                self.reasons[verdict.reason] += 1
            case NoMatch():
                failed[verdict.cause.what] += 1


def limit_matches(limit: int | None, found: Generator[Result], funnel: Funnel) -> Generator[Result]:
    """Yield results until there are enough matches; then close the generator that makes them.

    Args:
        limit: How many; None for all.
        found: The results.
        funnel: Takes the match at which they ended.
    """
    left = limit
    with closing(found):
        for result in found:
            yield result
            if left is not None and isinstance(result.verdict, Match):
                left -= 1
                if left <= 0:
                    funnel.limited = result
                    return
