"""What a query has found, by frame of the dataset: which frames match, who plays which role, with which values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.evaluate.annotations import Annotations, Frames

__all__ = ["Matched", "Played", "read_matched"]

Bools = NDArray[np.bool_]

_EGO = "ego"
_LARGEST = 700.0
"""Logarithm of the largest weight that a float can hold, about."""


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """The label objects that play one role.

    Attributes:
        name: Of the role.
        objects: Their numbers, each once, shape (n,).
    """

    name: str
    objects: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """The frames of a dataset as one query divides them.

    Attributes:
        name: Of the scenario.
        matching: Frames that match, shape (frames,).
        decided: Frames that match or do not; the others are unknown.
        roles: In the order of their first match; what the recording vehicle plays is left out.
        witness: The values of the random variables by frame, of its first match.
        log_weight: How much each frame counts where frames are to be spread as the program spreads its scenes, nan
            where the results do not say, shape (frames,); None where they say it of none.
    """

    name: str
    matching: Bools
    decided: Bools
    roles: tuple[Played, ...]
    witness: Mapping[int, Mapping[str, Any]]
    log_weight: NDArray[np.float64] | None = None


def read_matched(name: str, records: Iterable[Mapping[str, Any]], frames: Frames, objects: Annotations) -> Matched:
    """Divide the frames of a dataset by the results of a query.

    Frames that the results do not name count as decided: a query names what matches and what is unknown.

    Args:
        name: Of the scenario.
        records: Results for frames, or for intervals (whose roles are played by tracks).
        frames: The dataset's.
        objects: Its label objects.

    Raises:
        DataError: file-invalid: a result is of a frame or an object that the dataset does not have.
    """
    matching = np.zeros(len(frames.names), dtype=np.bool_)
    unknown = np.zeros(len(frames.names), dtype=np.bool_)
    starts = np.searchsorted(objects.frame, np.arange(len(frames.names) + 1))
    played: dict[str, dict[int, None]] = {}
    witness: dict[int, Mapping[str, Any]] = {}
    log_weight = np.full(len(frames.names), np.nan)
    ranked = False
    recordings = {recording: number for number, recording in enumerate(frames.recordings)}
    for each in records:
        verdict = each.get("verdict")
        if verdict not in ("match", "unknown"):
            continue
        where = _frames_of(name, each, frames, recordings)
        if verdict == "unknown":
            unknown[where] = True
            continue
        matching[where] = True
        known = _known(each, "witness")
        if "log_weight" in each:
            ranked = True
            log_weight[where] = _log_weight(name, each["log_weight"])
        names = objects.ids if "frame" in each else objects.tracks
        roles = {role: its for role, its in _known(each, "correspondence").items() if its != _EGO}
        for frame in where:
            witness.setdefault(frame, known)
            first, count = int(starts[frame]), int(starts[frame + 1] - starts[frame])
            own: list[str] = names.slice(first, count).to_pylist()
            # the first of those that share a name
            here = {own[place]: first + place for place in range(count - 1, -1, -1)}
            for role, its in roles.items():
                if its in here:
                    played.setdefault(role, {})[here[its]] = None
                elif "frame" in each:
                    raise _lacking(name, f"`{its}` in frame {frames.names[frame]}")
    return Matched(
        name=name,
        matching=matching,
        decided=matching | ~unknown,
        roles=tuple(Played(role, np.array(sorted(numbers), dtype=np.int64)) for role, numbers in played.items()),
        witness=witness,
        log_weight=log_weight if ranked else None,
    )


def _log_weight(name: str, told: Any) -> float:
    """A weight that results say; text where they are CSV, nan where it is not known."""
    try:
        value = math.nan if told in (None, "") else float(told)
    except (TypeError, ValueError):
        value = math.inf
    if abs(value) > _LARGEST:
        raise DataError(Diagnostic("file-invalid", f"results of {name}: {told!r} is no `log_weight`"))
    return value


def _known(each: Mapping[str, Any], name: str) -> dict[str, Any]:
    """What a result says under a name, without what is null."""
    told: Mapping[str, Any] = each.get(name) or {}
    return {key: value for key, value in told.items() if value is not None}


def _frames_of(name: str, each: Mapping[str, Any], frames: Frames, recordings: Mapping[str, int]) -> list[int]:
    if "frame" in each:
        number = frames.numbers.get(each["frame"])
        if number is None:
            raise _lacking(name, f"frame {each['frame']}")
        return [number]
    recording = recordings.get(each.get("recording", ""))
    if recording is None:
        raise _lacking(name, f"recording {each.get('recording')}")
    start, end = each.get("start_us"), each.get("end_us")
    if not isinstance(start, int) or not isinstance(end, int):
        message = f"results of {name}: an interval of {each['recording']} lacks `start_us` or `end_us`"
        raise DataError(Diagnostic("file-invalid", message))
    inside = (frames.recording == recording) & (frames.timestamp_us >= start) & (frames.timestamp_us <= end)
    return np.flatnonzero(inside).tolist()


def _lacking(name: str, what: str) -> DataError:
    message = f"results of {name}: the dataset does not have {what}"
    return DataError(Diagnostic("file-invalid", message, hints=("results and dataset must belong together",)))
