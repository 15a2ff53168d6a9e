"""The results of a query by frame of the dataset: which frames match, with which objects and values."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.evaluate.annotations import Annotations, Frames
from scenicq.query.execution.records import FrameRecord, IntervalRecord, Record
from scenicq.query.execution.result_summary import Completeness

__all__ = ["FrameSplit", "RolePlayers", "split_frames"]

Bools = NDArray[np.bool_]

_EGO = "ego"
_LARGEST = 700.0
"""Logarithm of the largest weight that a float can hold, about."""


@dataclass(frozen=True, slots=True, eq=False)
class RolePlayers:
    """The label objects that play one role.

    Attributes:
        name: The role's name.
        objects: Their numbers, each once, shape (n,).
    """

    name: str
    objects: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class FrameSplit:
    """The frames of a dataset as one query divides them.

    Attributes:
        name: The scenario's name.
        matching: Frames that match, shape (frames,).
        decided: Frames that match or do not; the others are unknown.
        settled: Frames of which nothing is unknown: there are no more correspondences than those that are said.
        roles: In the order of their first match; what the recording vehicle plays is left out.
        witness: The values of the random variables by frame, of its first match.
        log_weight: How much each frame counts where frames are to be spread as the program spreads its scenes, nan
            where the results do not say, shape (frames,); None where they say it of none.
        every: Whether the results say every correspondence of each frame that matches.
        variables: What the program says at the place of each random variable, as far as the results say it.
    """

    name: str
    matching: Bools
    decided: Bools
    settled: Bools
    roles: tuple[RolePlayers, ...]
    witness: Mapping[int, Mapping[str, Any]]
    log_weight: NDArray[np.float64] | None = None
    every: bool = True
    variables: Mapping[str, str] = field(default_factory=dict[str, str])

    @property
    def free(self) -> Bools:
        """Frames that match, and whose objects without a role surely can play none, shape (frames,)."""
        return self.matching & self.settled if self.every else np.zeros(len(self.matching), dtype=np.bool_)


def split_frames(
    name: str, records: Iterable[Record], frames: Frames, objects: Annotations,
    completeness: Callable[[], Completeness] | None = None,
) -> FrameSplit:  # fmt: skip
    """Divide the frames of a dataset by the results of a query.

    Frames that the results do not name do not match, where the results are complete: a query names what matches and
    what is unknown.

    Args:
        name: The scenario's name.
        records: Results for frames, or for intervals (whose roles are played by tracks).
        frames: The dataset's.
        objects: Its label objects.
        completeness: What it means that a frame is not among them, asked once all are taken; that it does not match,
            where nobody says.

    Raises:
        DataError: file-invalid: a result is of a frame or an object that the dataset does not have.
    """
    matching = np.zeros(len(frames.names), dtype=np.bool_)
    unknown = np.zeros(len(frames.names), dtype=np.bool_)
    starts = np.searchsorted(objects.frame, np.arange(len(frames.names) + 1))
    played: dict[str, dict[int, None]] = {}
    witness: dict[int, Mapping[str, Any]] = {}
    log_weight = np.full(len(frames.names), np.nan)
    ranked, every = False, True
    recordings = {recording: number for number, recording in enumerate(frames.recordings)}
    for each in records:
        if each.verdict == "no_match":
            continue
        where = _frames_of(name, each, frames, recordings)
        if each.verdict == "unknown":
            unknown[where] = True
            continue
        matching[where] = True
        every = every and (isinstance(each, IntervalRecord) or each.all_matches is True)
        if each.log_weight is not UNSET:
            ranked = True
            log_weight[where] = _log_weight(name, each.log_weight)
        of_frame = isinstance(each, FrameRecord)
        names = objects.ids if of_frame else objects.tracks
        roles = {role: its for role, its in each.correspondence.items() if its != _EGO}
        for frame in where:
            witness.setdefault(frame, each.witness)
            first, count = int(starts[frame]), int(starts[frame + 1] - starts[frame])
            own: list[str] = names.slice(first, count).to_pylist()
            # the first of those that share a name
            here = {own[place]: first + place for place in range(count - 1, -1, -1)}
            for role, its in roles.items():
                if its in here:
                    played.setdefault(role, {})[here[its]] = None
                elif of_frame:
                    raise _lacking(name, f"`{its}` in frame {frames.names[frame]}")
    variables: Mapping[str, str] = {}
    if completeness is not None:
        said = completeness()
        _mark_silent(unknown, frames, said)
        variables = {} if said.summary is None else said.summary.variables
    return FrameSplit(
        name=name,
        matching=matching,
        decided=matching | ~unknown,
        settled=~unknown,
        roles=tuple(RolePlayers(role, np.array(sorted(numbers), dtype=np.int64)) for role, numbers in played.items()),
        witness=witness,
        log_weight=log_weight if ranked else None,
        every=every,
        variables=variables,
    )


def _mark_silent(unknown: Bools, frames: Frames, said: Completeness) -> None:
    """Mark the frames of which results say nothing; which other objects may play a role is not known, either.

    Args:
        unknown: Where they are marked.
        frames: The dataset's.
        said: What it means that a frame is not named.
    """
    if said.whole or said.summary is None:
        return
    times_us: list[int] = frames.timestamp_us.tolist()
    recordings: list[int] = frames.recording.tolist()
    for number, (frame, recording) in enumerate(zip(frames.names, recordings, strict=True)):
        unknown[number] |= bool(said.why_silent(frames.recordings[recording], times_us[number], frame))


def _log_weight(name: str, told: float | None) -> float:
    """A weight that results say, nan where it is not known."""
    if told is None:
        return math.nan
    if not abs(told) <= _LARGEST:
        raise DataError(Diagnostic("file-invalid", f"results of {name}: {told!r} is no `log_weight`"))
    return told


def _frames_of(name: str, each: Record, frames: Frames, recordings: Mapping[str, int]) -> list[int]:
    if isinstance(each, FrameRecord):
        number = frames.numbers.get(each.frame)
        if number is None:
            raise _lacking(name, f"frame {each.frame}")
        return [number]
    recording = recordings.get(each.recording)
    if recording is None:
        raise _lacking(name, f"recording {each.recording}")
    inside = frames.recording == recording
    inside &= (frames.timestamp_us >= each.start_us) & (frames.timestamp_us <= each.end_us)
    return np.flatnonzero(inside).tolist()


def _lacking(name: str, what: str) -> DataError:
    message = f"results of {name}: the dataset does not have {what}"
    return DataError(Diagnostic("file-invalid", message, hints=("results and dataset must belong together",)))
