"""Results in runs: consecutive frames of one recording with the same verdict."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, cast

from scenicq.match.verdict import Match, NoMatch, Unknown
from scenicq.query.execution.results import Result
from scenicq.store.dataset import Dataset

__all__ = ["FrameRun", "find_runs", "frame_numbers"]


@dataclass(frozen=True, slots=True)
class FrameRun:
    """Consecutive frames of a recording with one kind of verdict.

    Attributes:
        recording: The recording.
        results: Their results in order of time, at least one.
        first: Number of the first frame in its recording, from 1.
        of: Frames of the recording.
        timeline: A picture of what held when in an interval.
    """

    recording: str
    results: tuple[Result, ...]
    first: int
    of: int
    timeline: str = ""

    @property
    def kind(self) -> str:
        """The kind of verdict: match, unknown, or near (a near miss)."""
        match self.results[0].verdict:
            case Match():
                return "match"
            case Unknown():
                return "unknown"
            case NoMatch():
                return "near"


def frame_numbers(dataset: Dataset, recordings: Iterable[str]) -> dict[str, tuple[int, int]]:
    """For each frame of some recordings its number there, from 1, and how many frames the recording has."""
    wanted = sorted(set(recordings))
    connection = dataset.connect()
    try:
        rows = connection.execute(
            "SELECT frame, row_number() OVER (PARTITION BY recording ORDER BY timestamp_us, frame), "
            "count(*) OVER (PARTITION BY recording) FROM labels WHERE list_contains(?, recording)",
            [wanted],
        ).fetchall()
    finally:
        connection.close()
    return {frame: (number, count) for frame, number, count in cast("list[tuple[str, int, int]]", cast(Any, rows))}


def find_runs(results: Sequence[Result], numbers: dict[str, tuple[int, int]]) -> list[FrameRun]:
    """Group results into runs, in their own order.

    Args:
        results: In order of recording and time.
        numbers: As `frame_numbers` gives them.
    """
    runs: list[FrameRun] = []
    for result in results:
        number, count = numbers[result.frame]
        last = runs[-1] if runs else None
        if (
            last is not None
            and last.recording == result.recording
            and last.first + len(last.results) == number
            and type(last.results[-1].verdict) is type(result.verdict)
        ):
            runs[-1] = FrameRun(last.recording, (*last.results, result), last.first, count)
        else:
            runs.append(FrameRun(result.recording, (result,), number, count))
    return runs
