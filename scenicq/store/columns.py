"""The labels of one recording as columns: importers make them, and the rows of all tables are made of them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.camera import Camera
from scenicq.store.labels import LabelObject, OutOfPlane, Recording

__all__ = [
    "OUT_OF_PLANE",
    "MemberColumns",
    "Memberships",
    "RecordingColumns",
    "columns_of",
    "pick_rows",
    "second_of_track",
    "take_labels",
    "to_json",
]

OUT_OF_PLANE = ("z", "pitch", "roll")
"""Columns of height and tilt."""
_FLAT = OutOfPlane()

_encode = json.JSONEncoder(ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode


@dataclass(frozen=True, slots=True, eq=False)
class MemberColumns:
    """Properties of some egos or label objects, one element each; nan and None stand for what is unobserved.

    Attributes:
        id, category, source_class, track: As in `LabelObject`.
        x, y, heading, width, length, height, vx, vy: Metres, radians and metres per second, shape (n,).
        attributes: JSON texts; None where there is nothing.
        z, pitch, roll: As in `OutOfPlane`, shape (n,); None where nothing is known of any.
    """

    id: Sequence[str]
    category: Sequence[str]
    source_class: Sequence[str]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    heading: NDArray[np.float64]
    width: NDArray[np.float64]
    length: NDArray[np.float64]
    height: NDArray[np.float64]
    vx: NDArray[np.float64]
    vy: NDArray[np.float64]
    track: Sequence[str | None]
    attributes: Sequence[str | None]
    z: NDArray[np.float64] | None = None
    pitch: NDArray[np.float64] | None = None
    roll: NDArray[np.float64] | None = None

    def take(self, rows: NDArray[np.int64]) -> MemberColumns:
        """Pick some rows, in the given order."""
        return MemberColumns(**{each.name: pick_rows(getattr(self, each.name), rows) for each in fields(self)})


@dataclass(frozen=True, slots=True, eq=False)
class RecordingColumns:
    """A recording, by column; labels in order of time, then of frame.

    Attributes:
        name, map: As in `Recording`.
        frames, times_us, params: One element a label; `params` are JSON texts, None where there is nothing.
        egos: One a label.
        objects: The objects of all labels, those of one label together, in the order of the labels.
        object_counts, sensor_counts: How many each label has, shape (labels,).
        channels, paths: Sensor files of all labels.
        cameras: The camera of each sensor file, None for what is none or not calibrated; empty where none is.
    """

    name: str
    map: str
    frames: Sequence[str]
    times_us: Sequence[int]
    params: Sequence[str | None]
    egos: MemberColumns
    objects: MemberColumns
    object_counts: NDArray[np.int64]
    sensor_counts: NDArray[np.int64]
    channels: Sequence[str]
    paths: Sequence[str]
    cameras: Sequence[Camera | None] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Memberships:
    """Pairs of a position and a region near it, by position, then in the order of the map.

    Attributes:
        point: Number of the position, shape (n,).
        feature: Number of the map element, shape (n,).
        distance: Metres; 0 inside and on the boundary, shape (n,).
    """

    point: NDArray[np.int64]
    feature: NDArray[np.int64]
    distance: NDArray[np.float64]


def columns_of(recording: Recording) -> RecordingColumns:
    """Make columns of plain labels."""
    labels = recording.labels
    return RecordingColumns(
        name=recording.name,
        map=recording.map,
        frames=[label.frame for label in labels],
        times_us=[label.timestamp_us for label in labels],
        params=[to_json(label.params) for label in labels],
        egos=_members([label.ego for label in labels]),
        objects=_members([member for label in labels for member in label.objects]),
        object_counts=np.array([len(label.objects) for label in labels], dtype=np.int64),
        sensor_counts=np.array([len(label.sensors) for label in labels], dtype=np.int64),
        channels=[channel for label in labels for channel in label.sensors],
        paths=[path for label in labels for path in label.sensors.values()],
        cameras=[label.cameras.get(channel) for label in labels for channel in label.sensors],
    )


def second_of_track(recording: RecordingColumns) -> int | None:
    """Find the first row of `objects` that shares its track with the ego or another object of its label, or None."""
    labels = np.repeat(np.arange(len(recording.object_counts)), recording.object_counts).tolist()
    seen = {(label, track) for label, track in enumerate(recording.egos.track) if track is not None}
    for row, (label, track) in enumerate(zip(labels, recording.objects.track, strict=True)):
        if track is not None:
            if (label, track) in seen:
                return row
            seen.add((label, track))
    return None


def take_labels(
    recording: RecordingColumns, labels: Sequence[int], objects: NDArray[np.bool_], sensors: NDArray[np.bool_]
) -> RecordingColumns:
    """Pick some labels of a recording, in a given order.

    Args:
        recording: The recording.
        labels: Numbers of its labels.
        objects: Which of all objects stay with their labels, shape (n,).
        sensors: The same of sensor files.
    """
    numbers = np.array(labels, dtype=np.int64)
    own, object_counts = _rows_of(recording.object_counts, numbers, objects)
    files, sensor_counts = _rows_of(recording.sensor_counts, numbers, sensors)
    return RecordingColumns(
        name=recording.name,
        map=recording.map,
        frames=pick_rows(recording.frames, numbers),
        times_us=pick_rows(recording.times_us, numbers),
        params=pick_rows(recording.params, numbers),
        egos=recording.egos.take(numbers),
        objects=recording.objects.take(own),
        object_counts=object_counts,
        sensor_counts=sensor_counts,
        channels=pick_rows(recording.channels, files),
        paths=pick_rows(recording.paths, files),
        cameras=pick_rows(recording.cameras, files) if recording.cameras else (),
    )


def pick_rows(values: Any, rows: NDArray[np.intp]) -> Any:
    """Pick the values of some rows, in the given order; None where there is no column."""
    if values is None or isinstance(values, np.ndarray):
        return None if values is None else values[rows]
    numbers: list[int] = rows.tolist()
    return [values[number] for number in numbers]


def _rows_of(
    counts: NDArray[np.int64], numbers: NDArray[np.int64], stays: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The rows of some labels that stay, and how many each of them has."""
    ends = np.cumsum(counts)
    rows = [np.arange(end - count, end) for end, count in zip(ends[numbers], counts[numbers], strict=True)]
    rows = [own[stays[own]] for own in rows]
    return np.concatenate([np.zeros(0, dtype=np.int64), *rows]), np.array([len(own) for own in rows], dtype=np.int64)


def to_json(values: Mapping[str, Any]) -> str | None:
    """The JSON text of some values; None where there are none."""
    return _encode(dict(values)) if values else None


def _members(members: Sequence[LabelObject]) -> MemberColumns:
    space = [member.out_of_plane or _FLAT for member in members]
    return MemberColumns(
        id=[member.id for member in members],
        category=[member.category for member in members],
        source_class=[member.source_class for member in members],
        x=_reals([member.x for member in members]),
        y=_reals([member.y for member in members]),
        heading=_reals([member.heading for member in members]),
        width=_reals([member.width for member in members]),
        length=_reals([member.length for member in members]),
        height=_reals([member.height for member in members]),
        vx=_reals([None if member.velocity is None else member.velocity[0] for member in members]),
        vy=_reals([None if member.velocity is None else member.velocity[1] for member in members]),
        track=[member.track for member in members],
        attributes=[to_json(member.attributes) for member in members],
        z=_reals([each.z for each in space]),
        pitch=_reals([each.pitch for each in space]),
        roll=_reals([each.roll for each in space]),
    )


def _reals(values: Sequence[float | None]) -> NDArray[np.float64]:
    return np.array([math.nan if value is None else value for value in values], dtype=np.float64)
