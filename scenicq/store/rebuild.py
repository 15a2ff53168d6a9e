"""Compute anew what a dataset's tables hold beside the labels: `scenicq index`.

Labels, objects, sensors and maps stay as they are; lanes, directions, memberships, positions relative to the ego and
counts come from them. The result is byte for byte that of an ingest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.store.camera_rows import CAMERA_COLUMNS, cameras_of
from scenicq.store.columns import OUT_OF_PLANE, MemberColumns, RecordingColumns
from scenicq.store.dataset import Dataset
from scenicq.store.manifest import Manifest
from scenicq.store.map_validation import check_regions
from scenicq.store.rules import check_counts
from scenicq.store.schema import ADDED, ArrowTable
from scenicq.store.segment import MapIndexes, SegmentWriter, read_segments
from scenicq.store.validation import read_sound
from scenicq.store.writer import DatasetWriter

__all__ = ["rebuild", "recordings_of"]

_REALS = ("x", "y", "heading", "width", "length", "height", "vx", "vy")
_PROPERTIES = ("class", "source_class", *_REALS, "track", "attributes", *OUT_OF_PLANE)
_SOURCES = {
    "labels": [
        *("frame", "recording", "timestamp_us", "map", "params"),
        *("object_count", "first_object", "sensor_count", "first_sensor"),
        *(f"ego_{name}" for name in _PROPERTIES),
    ],
    "objects": ["id", *_PROPERTIES],
    "sensors": ["channel", "path", *CAMERA_COLUMNS],
}
"""The columns that are not computed."""


def rebuild(dataset: Dataset, progress: Callable[[int], None] | None = None) -> Manifest:
    """Compute a dataset's computed columns anew, and replace it; after an error it stays as it was.

    Args:
        dataset: The dataset; open it again afterwards.
        progress: Called with the number of frames done since the last call.

    Raises:
        DataError: `store-damaged`, `dataset-invalid` where labels, objects, sensors or maps are not sound, or
            `target-unwritable`.
    """
    before = dataset.manifest
    segments = read_segments(dataset.path)
    labels = tuple(segments[number].part("labels", number) for number in sorted(segments))
    if labels != before.tables["labels"]:
        message = f"{dataset.path} lacks descriptions of its parts"
        raise DataError(Diagnostic("store-damaged", message, hints=("ingest the source again",)))
    with dataset.blamed():
        for each, file in zip(before.tables["regions"], dataset.files("regions"), strict=True):
            check_regions(read_sound("regions", file, each.path), each.path, before.maps)
    maps = {name: dataset.features(name) for name in before.maps}
    indexes = MapIndexes(maps)
    with DatasetWriter(dataset.path, maps, update=True) as writer:
        try:
            for number, old in segments.items():
                with dataset.blamed():
                    rows = _sources(dataset, number)
                part = SegmentWriter(writer.folder, number)
                try:
                    part.open()
                    for columns in recordings_of(rows["labels"], rows["objects"], rows["sensors"]):
                        part.add(columns, indexes.of(columns.map))
                        if progress is not None:
                            progress(len(columns.frames))
                    writer.adopt(number, part.finish(old.fingerprint, old.pieces))
                finally:
                    part.abandon()
        except OSError as error:
            raise writer.unwritable(error) from error
        dataset.release()
        return writer.finish(
            name=before.name, importer=before.importer, left_out=before.left_out, provenance=before.provenance
        )


def recordings_of(
    label_rows: ArrowTable, object_rows: ArrowTable, sensor_rows: ArrowTable
) -> Iterator[RecordingColumns]:
    """Read the recordings of a part, without computed columns.

    Args:
        label_rows: Rows of the table `labels`.
        object_rows: Rows of the table `objects`.
        sensor_rows: Rows of the table `sensors`.
    """
    names = label_rows["recording"].to_pylist()
    starts = [row for row, name in enumerate(names) if row == 0 or names[row - 1] != name]
    first_object = first_sensor = 0
    for start, end in zip(starts, [*starts[1:], len(names)], strict=True):
        own = label_rows.slice(start, end - start)
        object_counts, sensor_counts = (_whole(own[name]) for name in ("object_count", "sensor_count"))
        channels = sensor_rows.slice(first_sensor, int(sensor_counts.sum()))
        others = object_rows.slice(first_object, int(object_counts.sum()))
        first_object += len(others)
        first_sensor += len(channels)
        yield RecordingColumns(
            name=names[start],
            map=own["map"][0].as_py(),
            frames=own["frame"].to_pylist(),
            times_us=own["timestamp_us"].to_pylist(),
            params=own["params"].to_pylist(),
            egos=_members(own, "ego_", ["ego"] * len(own)),
            objects=_members(others, "", others["id"].to_pylist()),
            object_counts=object_counts,
            sensor_counts=sensor_counts,
            channels=channels["channel"].to_pylist(),
            paths=channels["path"].to_pylist(),
            cameras=cameras_of(channels),
        )


def _sources(dataset: Dataset, number: int) -> dict[str, ArrowTable]:
    """The tables of a part that others are computed from, without what is computed in them."""
    manifest = dataset.manifest
    parts = {table: manifest.tables[table][number] for table in _SOURCES}
    later = {name for version, names in ADDED.items() if version > manifest.schema for name in names}
    rows: dict[str, ArrowTable] = {}
    for table, part in parts.items():
        there = [name for name in _SOURCES[table] if name.removeprefix("ego_") not in later]
        rows[table] = read_sound(table, dataset.place.file(part), part.path, there)
    check_counts(rows, {table: part.path for table, part in parts.items()})
    return rows


def _members(rows: ArrowTable, prefix: str, ids: list[str]) -> MemberColumns:
    texts: dict[str, list[Any]] = {
        name: rows[prefix + name].to_pylist() for name in ("class", "source_class", "track", "attributes")
    }
    known = [name for name in OUT_OF_PLANE if prefix + name in rows.column_names]
    reals = {name: _reals(rows[prefix + name]) for name in (*_REALS, *known)}
    return MemberColumns(
        id=ids,
        category=texts["class"],
        source_class=texts["source_class"],
        track=texts["track"],
        attributes=texts["attributes"],
        **reals,
    )


def _whole(column: pa.ChunkedArray) -> NDArray[np.int64]:
    return column.to_numpy().astype(np.int64)


def _reals(column: pa.ChunkedArray) -> NDArray[np.float64]:
    """Null becomes nan."""
    return column.to_numpy().astype(np.float64)
