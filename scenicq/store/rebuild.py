"""Computing anew what a dataset's tables hold beside the labels: `scenicq index`.

Labels, objects, sensors and maps stay as they are; lanes, directions, memberships, positions relative to the ego and
counts come from them. The result is byte for byte that of an ingest.
"""

# pyarrow has no type stubs.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.store.columns import MemberColumns, RecordingColumns
from scenicq.store.dataset import Dataset
from scenicq.store.manifest import Manifest
from scenicq.store.schema import ArrowTable
from scenicq.store.segment import MapIndexes, SegmentWriter, read_segments
from scenicq.store.writer import DatasetWriter

__all__ = ["rebuild"]


def rebuild(dataset: Dataset, progress: Callable[[int], None] | None = None) -> Manifest:
    """Replace a dataset by one whose computed columns are computed anew; all of it or, after an error, nothing.

    Args:
        dataset: The dataset; open it again afterwards.
        progress: Called with the number of frames done since the last call.

    Raises:
        DataError: `store-damaged`, or `target-unwritable`.
    """
    before = dataset.manifest
    segments = read_segments(dataset.path)
    labels = tuple(segments[number].part("labels", number) for number in sorted(segments))
    if labels != before.tables["labels"]:
        message = f"{dataset.path} lacks descriptions of its parts"
        raise DataError(Diagnostic("store-damaged", message, hints=("ingest the source again",)))
    maps = {name: dataset.features(name) for name in before.maps}
    indexes = MapIndexes(maps)
    with DatasetWriter(dataset.path, maps, update=True) as writer:
        try:
            for number, old in segments.items():
                files = (
                    dataset.path.resolve() / before.tables[table][number].path
                    for table in ("labels", "objects", "sensors")
                )
                part = SegmentWriter(writer.folder, number)
                try:
                    part.open()
                    for columns in _recordings(*files):
                        part.add(columns, indexes.of(columns.map))
                        if progress is not None:
                            progress(len(columns.frames))
                    writer.adopt(number, part.finish(old.fingerprint, old.counts, old.told))
                finally:
                    part.abandon()
        except OSError as error:
            raise writer.unwritable(error) from error
        dataset.release()
        return writer.finish(
            name=before.name, importer=before.importer, left_out=before.left_out, provenance=before.provenance
        )


def _recordings(labels: Path, objects: Path, sensors: Path) -> Iterator[RecordingColumns]:
    """The recordings of a part."""
    with pq.ParquetFile(labels) as frames, pq.ParquetFile(objects) as members, pq.ParquetFile(sensors) as files:
        label_rows, object_rows, sensor_rows = frames.read(), members.read(), files.read()
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
        )


def _members(rows: ArrowTable, prefix: str, ids: list[str]) -> MemberColumns:
    texts: dict[str, list[Any]] = {
        name: rows[prefix + name].to_pylist() for name in ("class", "source_class", "track", "attributes")
    }
    reals = {
        name: _reals(rows[prefix + name]) for name in ("x", "y", "heading", "width", "length", "height", "vx", "vy")
    }
    return MemberColumns(
        id=ids,
        category=texts["class"],
        source_class=texts["source_class"],
        track=texts["track"],
        attributes=texts["attributes"],
        **reals,
    )


def _whole(column: Any) -> NDArray[np.int64]:
    return column.to_numpy().astype(np.int64)


def _reals(column: Any) -> NDArray[np.float64]:
    """Null becomes nan."""
    return column.to_numpy().astype(np.float64)
