"""What a result says of itself: how it was made, and of which frames it says nothing.

A frame that a result does not name does not match, unless nobody has looked at it, or its match was left out. Files
carry a summary with their last result, so that whoever reads them can tell the two apart.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import msgspec
from msgspec import UNSET, Struct, UnsetType

from scenicq.errors import DataError, Diagnostic

if TYPE_CHECKING:
    from scenicq.query.execution.records import Record

__all__ = [
    "RESULT_VERSION",
    "Completeness",
    "ResultCount",
    "ResultSummary",
    "Stretch",
    "join_summaries",
    "refuse_newer",
]

RESULT_VERSION = 1
"""Changes where a reader of before would take results for something else, not where a field is only added."""

End = Literal["deadline", "limit"]
"""What ends a query before all frames are looked at."""


class Stretch(Struct, frozen=True, omit_defaults=True, kw_only=True):
    """Frames that follow each other in the order of recording, time and frame, and that nobody has looked at.

    Attributes:
        why: What ended the query.
        frames: How many they are.
        first, last: Their first and their last recording.
        from_us, from_frame: The first of them in the first recording; absent where that is its first frame.
    """

    why: End
    frames: int
    first: str
    last: str
    from_us: int | UnsetType = UNSET
    from_frame: str | UnsetType = UNSET

    def has(self, recording: str, timestamp_us: int, frame: str) -> bool:
        """Whether a frame is one of them."""
        if not self.first <= recording <= self.last:
            return False
        if recording > self.first or self.from_us is UNSET or self.from_frame is UNSET:
            return True
        return (timestamp_us, frame) >= (self.from_us, self.from_frame)


class ResultSummary(Struct, frozen=True, omit_defaults=True, kw_only=True):
    """How a result was made, and what it does not say.

    Attributes:
        version: That of results; 0 where none is stated, as by those of before.
        complete: Whether every frame was looked at, and all that was found is there.
        results: How many results there are.
        frames: How many frames were asked about.
        unknown: How many frames or intervals are undecided, by the reason.
        all_matches: Whether every correspondence of a frame is a result; else one of each frame is.
        limit: Matches after which the query was to stop.
        sample: How many matches were drawn, where not all were wanted.
        sampled_from: The number that they were sampled from.
        where: The condition on recorded values that matches meet.
        sort: The recorded value that they are ordered by.
        left_out: How many matches are left out: they do not meet the condition, that is not known, or they come behind
            the limit of an order.
        skipped: Frames that nobody has looked at.
        variables: What the program says at the place of each random variable of its author's, for readers of witnesses.
    """

    version: int = 0
    complete: bool
    results: int
    frames: int
    unknown: dict[str, int] = {}
    all_matches: bool = False
    limit: int | UnsetType = UNSET
    sample: int | UnsetType = UNSET
    sampled_from: int | UnsetType = UNSET
    where: str | UnsetType = UNSET
    sort: str | UnsetType = UNSET
    left_out: int = 0
    skipped: tuple[Stretch, ...] = ()
    variables: dict[str, str] = {}

    @property
    def why_cut(self) -> str:
        """What it leaves out, in words; "" where it is complete."""
        told: list[str] = []
        skipped = Counter[End]()
        for each in self.skipped:
            skipped[each.why] += each.frames
        for why, frames in skipped.items():
            limit = f" {self.limit}" if why == "limit" and self.limit is not UNSET else ""
            told.append(f"--{why}{limit} ended the query before {frames:,} of {self.frames:,} frames were looked at")
        if self.sample is not UNSET and not self.complete:
            told.append(f"--sample shows {self.sample:,} of {self.sampled_from or 0:,} matches")
        if self.left_out:
            told.append(f"{self.chosen_by} leaves out {self.left_out:,} matches")
        return ", and ".join(told) or ("" if self.complete else "something was left out")

    @property
    def chosen_by(self) -> str:
        """The options that have left matches out by what these carry; "" where none has."""
        where = f"--where '{self.where}'" if self.where else ""
        limit = f"--sort {self.sort} --limit {self.limit}" if self.sort and self.limit else ""
        return " with ".join(each for each in (where, limit) if each) if self.left_out else ""


def join_summaries(parts: Sequence[ResultSummary]) -> ResultSummary | None:
    """The summary of results that are put together, such as those of shards; None where there are none."""
    if not parts:
        return None
    unknown = Counter[str]()
    for each in parts:
        unknown.update(each.unknown)
    sampled = [each for each in parts if each.sample is not UNSET]
    return ResultSummary(
        version=RESULT_VERSION,
        complete=all(each.complete for each in parts),
        results=sum(each.results for each in parts),
        frames=sum(each.frames for each in parts),
        unknown=dict(sorted(unknown.items())),
        all_matches=all(each.all_matches for each in parts),
        limit=next((each.limit for each in parts if each.limit is not UNSET), UNSET),
        sample=sum(each.sample or 0 for each in sampled) if sampled else UNSET,
        sampled_from=sum(each.sampled_from or 0 for each in sampled) if sampled else UNSET,
        where=next((each.where for each in parts if each.where is not UNSET), UNSET),
        sort=next((each.sort for each in parts if each.sort is not UNSET), UNSET),
        left_out=sum(each.left_out for each in parts),
        skipped=tuple(stretch for each in parts for stretch in each.skipped),
        variables={place: text for each in parts for place, text in each.variables.items()},
    )


class _Stated(Struct, frozen=True):
    version: int = 0


class _Line(Struct, frozen=True):
    summary: _Stated = _Stated()


def refuse_newer(name: str, line: str | bytes) -> None:
    """Refuse results of a version that this program does not know, before anything else of them is read.

    Args:
        name: What messages call the results.
        line: What carries their summary, as JSON; what holds none says nothing, and is for its reader to refuse.

    Raises:
        DataError: results-version.
    """
    try:
        version = msgspec.json.decode(line, type=_Line).summary.version
    except (msgspec.DecodeError, RecursionError):
        return
    if version > RESULT_VERSION:
        message = f"{name} holds results of version {version}; this program reads versions up to {RESULT_VERSION}"
        hints = ("a newer scenicq reads them", "else run the query again")
        raise DataError(Diagnostic("results-version", message, hints=hints))


@dataclass(slots=True)
class ResultCount:
    """Counts results as they are written.

    Attributes:
        results: How many.
        unknown: How many of them are undecided, by the reason.
    """

    results: int = 0
    unknown: Counter[str] = field(default_factory=Counter[str])

    def counted(self, records: Iterable[Record]) -> Iterable[Record]:
        """Count records while they are taken."""
        for each in records:
            self.add(each)
            yield each

    def add(self, record: Record) -> None:
        """Count one."""
        self.results += 1
        if record.verdict == "unknown":
            self.unknown[record.cause.reason if record.cause else ""] += 1


@dataclass(frozen=True, slots=True)
class Completeness:
    """What results that were read say by saying nothing.

    Attributes:
        summary: What they say of themselves; None where they say nothing, as those of older versions.
        held: How many results were read.
    """

    summary: ResultSummary | None
    held: int

    @property
    def whole(self) -> bool:
        """Whether every frame that is not named surely does not match."""
        return self.summary is not None and self.summary.complete and self.summary.results == self.held

    def why_silent(self, recording: str, timestamp_us: int, frame: str) -> str:
        """Why a frame, or an interval that begins with it, is not named; "" where it does not match.

        Results that say nothing of themselves are taken to be complete.
        """
        summary = self.summary
        if summary is None:
            return ""
        if summary.results != self.held:
            return "results are missing in the file"
        for each in summary.skipped:
            if each.has(recording, timestamp_us, frame):
                return f"not looked at: --{each.why} ended the query"
        if summary.left_out:
            return f"may be left out by {summary.chosen_by}"
        return "not in the sample" if summary.sample is not UNSET and not summary.complete else ""

    def doubt(self, name: str, consequence: str) -> Diagnostic | None:
        """A warning where the results are not complete, or nobody knows.

        Args:
            name: What messages call them.
            consequence: What that means for the reader.
        """
        if self.summary is None and not self.held:
            message = f"{name} is empty, and does not say whether all frames were looked at"
        elif self.summary is None:
            message = f"{name} does not say whether it is complete: an older version wrote it, or it was cut since"
        elif self.summary.results != self.held:
            message = f"{name} is not as it was written: it has {self.held:,} results, and had {self.summary.results:,}"
        elif not self.summary.complete:
            message = f"{name} is not complete: {self.summary.why_cut}"
        else:
            return None
        return Diagnostic("results-incomplete", message, hints=(consequence,), severity="warning")
