"""Read labels from rows, in batches.

Parts of one number hold the same recordings, and each row of `labels` says where its rows in the other tables begin; so
reading needs no join, and of chosen frames only the row groups that hold them are read.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import repeat
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenicq.geometry.camera import Camera
from scenicq.number_ranges import expand_ranges
from scenicq.store.camera_rows import CAMERA_COLUMNS, cameras_of
from scenicq.store.columns import OUT_OF_PLANE
from scenicq.store.labels import Label, LabelObject, Motion, OutOfPlane
from scenicq.store.place import StoreFile
from scenicq.store.row_block import RowBlock
from scenicq.store.schema import ArrowTable

if TYPE_CHECKING:
    from scenicq.store.recorded_tracks import RecordedTracks

__all__ = [
    "COURSE_COLUMNS",
    "EGO_COLUMNS",
    "LABEL_COLUMNS",
    "LAST",
    "MOTION_COLUMNS",
    "OBJECT_COLUMNS",
    "assemble",
    "course_ends",
    "read_labels",
]

_BATCH = 2048
_FEW = 64
"""Texts that are decoded one by one."""
LAST = "last_lane"
"""The column of the last lane of a track."""
OBJECT_COLUMNS = ["id", "class", "source_class", "x", "y", "heading", "width", "length", "height", "vx", "vy"]
OBJECT_COLUMNS.extend(("track", "attributes", LAST))
MOTION_COLUMNS = ["motion_vx", "motion_vy", "acceleration", "yaw_rate", "motion_derived"]
"""What is computed of motion; a query that does not ask for it need not read it."""
COURSE_COLUMNS = [f"ego_{axis}{end}" for axis in ("along", "beside") for end in ("", "_less", "_more")]
"""Where label objects are on the ego's course, which the ego itself has no columns for."""
EGO_COLUMNS = [f"ego_{name}" for name in OBJECT_COLUMNS[1:]]
LABEL_COLUMNS = ["frame", "recording", "timestamp_us", "map", "params", "object_count", "sensor_count"]
LABEL_COLUMNS.extend(("first_object", "first_sensor"))


def read_labels(
    parts: Sequence[tuple[StoreFile, StoreFile, StoreFile]],
    rows: NDArray[np.int64] | None,
    wanted: Collection[str] | None,
    *,
    motion: bool = True,
    space: bool = True,
    recorded: RecordedTracks | None = None,
) -> Iterator[Label]:
    """Read labels in the order of the store.

    Args:
        parts: Files of the tables `labels`, `objects` and `sensors`, part by part.
        rows: Rows of `labels` to look at, counted over all parts, in order; None for all.
        wanted: Frames to yield; None for all that are looked at.
        motion: Whether what is computed of motion is read, too.
        space: Whether heights, tilts and cameras are read, too.
        recorded: What labels name as that which has the tracks of their recordings.
    """
    more = [*(MOTION_COLUMNS if motion else []), *(OUT_OF_PLANE if space else [])]
    of_sensors = ["channel", "path", *(CAMERA_COLUMNS if space else [])]
    of_labels = [*LABEL_COLUMNS, *EGO_COLUMNS, *(f"ego_{name}" for name in more)]
    first = 0
    for labels, objects, sensors in parts:
        if rows is not None and not len(rows):
            return
        with RowBlock(labels, of_labels) as frame_rows:
            size = len(frame_rows)
            if rows is None:
                chosen = np.arange(size)
            else:
                inside = np.searchsorted(rows, first + size)
                chosen, rows = rows[:inside] - first, rows[inside:]
            first += size
            if len(chosen):
                with (
                    RowBlock(objects, [*OBJECT_COLUMNS, *more]) as object_rows,
                    RowBlock(sensors, of_sensors) as sensor_rows,
                ):
                    for start in range(0, len(chosen), _BATCH):
                        table = frame_rows.take(chosen[start : start + _BATCH])
                        if wanted is not None:
                            kept = [number for number, name in enumerate(table["frame"].to_pylist()) if name in wanted]
                            table = table if len(kept) == len(table) else table.take(kept)
                        others, channels = (
                            _members(object_rows, table, "object"),
                            _members(sensor_rows, table, "sensor"),
                        )
                        yield from assemble(table, others, channels, recorded)


def _members(rows: RowBlock, frames: ArrowTable, what: str) -> ArrowTable:
    """The rows of another table that belong to some frames."""
    first = frames[f"first_{what}"].to_numpy().astype(np.int64)
    counts = frames[f"{what}_count"].to_numpy().astype(np.int64)
    return rows.take(expand_ranges(first, counts))


def assemble(
    frames: ArrowTable, objects: ArrowTable, sensors: ArrowTable, recorded: RecordedTracks | None = None
) -> Iterator[Label]:
    """Make labels of rows.

    Args:
        frames: `LABEL_COLUMNS` and `EGO_COLUMNS` of each label; its counts say how many rows of the others are its own.
        objects: `OBJECT_COLUMNS`, label by label; both may have `MOTION_COLUMNS` and `OUT_OF_PLANE`, too, and may lack
            columns of what nobody looks at. It may have `COURSE_COLUMNS`.
        sensors: Channels and paths, label by label; it may have `CAMERA_COLUMNS`.
        recorded: As `read_labels` has it.
    """
    others = _objects([_values(objects, name) for name in OBJECT_COLUMNS], objects, "")
    egos = _objects([["ego"] * len(frames), *(_values(frames, name) for name in EGO_COLUMNS)], frames, "ego_")
    channels, paths, cameras = _values(sensors, "channel"), _values(sensors, "path"), cameras_of(sensors)
    seeing = any(camera is not None for camera in cameras)
    first = first_sensor = 0
    known: dict[str, Camera] = {}
    columns = [_values(frames, name) for name in LABEL_COLUMNS[:-2]]
    for ego, frame, recording, time, map_name, params, count, sensor_count in zip(egos, *columns, strict=True):
        stop, end = first + count, first_sensor + sensor_count
        names = channels[first_sensor:end]
        files = dict(zip(names, paths[first_sensor:end], strict=True))
        if seeing:
            pairs = zip(names, cameras[first_sensor:end], strict=True)
            known = {name: camera for name, camera in pairs if camera is not None}
        own = tuple(others[first:stop])
        yield Label(frame, recording, time, map_name, ego, own, params, files, known, recorded)
        first, first_sensor = stop, end


def _motions(table: ArrowTable, prefix: str) -> Iterable[Motion | None]:
    """The motion of each row, where the table has it."""
    if f"{prefix}motion_vx" not in table.column_names:
        return repeat(None)
    rows = zip(*(_values(table, prefix + name) for name in MOTION_COLUMNS), strict=True)
    return (
        Motion(None if vx is None else (vx, vy), acceleration, yaw_rate, derived)
        for vx, vy, acceleration, yaw_rate, derived in rows
    )


def _spaces(table: ArrowTable, prefix: str) -> Iterable[OutOfPlane | None]:
    """Height and tilt of each row, where the table has them."""
    names = [prefix + name for name in OUT_OF_PLANE]
    if names[0] not in table.column_names or all(table[name].null_count == len(table) for name in names):
        return repeat(None)
    rows = zip(*(_values(table, name) for name in names), strict=True)
    return (None if row == (None, None, None) else OutOfPlane(*row) for row in rows)


def _on_ego_course(table: ArrowTable, prefix: str) -> Iterable[tuple[float, float, float, float] | None]:
    """The ends between which each row is along and beside the ego's course, where the table has them."""
    if prefix or COURSE_COLUMNS[0] not in table.column_names:
        return repeat(None)
    return course_ends([table[name].to_numpy() for name in COURSE_COLUMNS])


def course_ends(columns: Sequence[NDArray[np.float64]]) -> Iterable[tuple[float, float, float, float]]:
    """The ends between which label objects are along and beside the ego's course.

    Args:
        columns: `COURSE_COLUMNS`, each of shape (n,).
    """
    ends: list[NDArray[np.float64]] = []
    for value, less, more in (columns[:3], columns[3:]):
        # nan where there is no end
        ends += [np.nan_to_num(value - less, nan=-np.inf), np.nan_to_num(value + more, nan=np.inf)]
    return zip(*(each.tolist() for each in ends), strict=True)


def _objects(columns: list[list[Any]], table: ArrowTable, prefix: str) -> list[LabelObject]:
    motions, spaces = _motions(table, prefix), _spaces(table, prefix)
    *before, vx, vy, track, attributes, last_lanes = columns
    velocities = [None if x is None else (x, y) for x, y in zip(vx, vy, strict=True)]
    courses = _on_ego_course(table, prefix)
    return [*map(LabelObject, *before, velocities, track, attributes, motions, spaces, last_lanes, courses)]


def _values(table: ArrowTable, name: str) -> list[Any]:
    """Python values of a column: null becomes None, and JSON is read; equal texts share one value.

    A column that was not read is null everywhere.
    """
    is_json = name.endswith(("attributes", "params"))
    if name not in table.column_names:
        return [{} if is_json else None] * len(table)
    column = table[name]
    if column.null_count == len(column):
        return [{} if is_json else None] * len(column)
    if is_json and not pa.types.is_dictionary(column.type):
        # to make a dictionary of it pyarrow would load another module
        texts_: list[str | None] = column.to_pylist()
        read: dict[str | None, Any] = {text: {} if text is None else json.loads(text) for text in set(texts_)}
        return [read[text] for text in texts_]
    if pa.types.is_dictionary(column.type):
        values: list[Any] = []
        for chunk in column.chunks:
            absent = len(chunk.dictionary)
            # nulls are nan here
            indices = np.nan_to_num(chunk.indices.to_numpy(zero_copy_only=False), nan=absent).astype(np.int64)
            # A slice shares the dictionary of its whole row group: decode only what it uses.
            used, places = np.unique(indices, return_inverse=True)
            wanted = used[used < absent].tolist()
            # few are taken one by one: pyarrow loads another module to take them together
            texts: list[Any] = (
                [chunk.dictionary[place].as_py() for place in wanted]
                if len(wanted) <= _FEW
                else chunk.dictionary.take(wanted).to_pylist()
            )
            distinct = [*map(json.loads, texts), {}] if is_json else [*texts, None]
            values += [distinct[place] for place in places.tolist()]
        return values
    if column.null_count == 0 and pa.types.is_primitive(column.type):
        return column.to_numpy().tolist()
    return column.to_pylist()
