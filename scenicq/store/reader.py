"""From rows back to labels, in batches.

The tables share one order, and `labels` counts the rows that each frame has in the others; so reading needs no join and
no search: the rows of a frame start where those of the frame before it end.
"""

# pyarrow has no type stubs.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import json
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from scenicq.store.labels import Label, LabelObject
from scenicq.store.schema import ArrowTable

__all__ = ["read_labels"]

_BATCH = 2048
_OBJECT_COLUMNS = ["id", "class", "source_class", "x", "y", "heading", "width", "length", "height", "vx", "vy"]
_OBJECT_COLUMNS.extend(("track", "attributes"))
_EGO_COLUMNS = [f"ego_{name}" for name in _OBJECT_COLUMNS[1:]]
_REPEATED = ("class", "track", "recording", "map", "channel", "attributes", "params")
"""Ends of the names of columns with few distinct texts in many rows: decoding each once is several times faster."""
_LABEL_COLUMNS = ["frame", "recording", "timestamp_us", "map", "params", "object_count", "sensor_count"]


def read_labels(
    labels: Sequence[Path], objects: Sequence[Path], sensors: Sequence[Path], wanted: frozenset[str] | None
) -> Iterator[Label]:
    """Labels in the order of the store.

    Args:
        labels: Files of the table `labels`.
        objects: Files of the table `objects`.
        sensors: Files of the table `sensors`.
        wanted: Frames to read; None for all.
    """
    with (
        _Rows(labels, [*_LABEL_COLUMNS, *_EGO_COLUMNS]) as frame_rows,
        _Rows(objects, _OBJECT_COLUMNS) as object_rows,
        _Rows(sensors, ["channel", "path"]) as sensor_rows,
    ):
        first_object = first_sensor = 0
        for start in range(0, len(frame_rows), _BATCH):
            table = frame_rows.read(start, min(start + _BATCH, len(frame_rows)))
            object_ends = list(accumulate(table["object_count"].to_pylist(), initial=first_object))
            sensor_ends = list(accumulate(table["sensor_count"].to_pylist(), initial=first_sensor))
            first_object, first_sensor = object_ends[-1], sensor_ends[-1]
            frames: list[str] = table["frame"].to_pylist()
            chosen = [number for number, frame in enumerate(frames) if wanted is None or frame in wanted]
            if chosen:
                yield from _labels(
                    _picked(table, chosen),
                    _members(object_rows, object_ends, chosen),
                    _members(sensor_rows, sensor_ends, chosen),
                )


def _members(rows: _Rows, ends: list[int], chosen: list[int]) -> ArrowTable:
    """The rows that belong to the chosen frames of a batch; those of frame i are `ends[i]` to `ends[i + 1]`."""
    start = ends[chosen[0]]
    table = rows.read(start, ends[chosen[-1] + 1])
    return _picked(table, [row - start for number in chosen for row in range(ends[number], ends[number + 1])])


def _picked(table: ArrowTable, rows: list[int]) -> ArrowTable:
    return table if len(rows) == len(table) else table.take(rows)


class _Rows:
    """The rows of a table as one range of numbers, decoded one row group at a time."""

    def __init__(self, paths: Sequence[Path], columns: list[str]) -> None:
        self._columns = columns
        shared = [name for name in columns if name.endswith(_REPEATED)]
        self._files = [pq.ParquetFile(path, read_dictionary=shared) for path in paths]
        self._groups = [(file, group) for file in self._files for group in range(file.num_row_groups)]
        sizes = (file.metadata.row_group(group).num_rows for file, group in self._groups)
        self._starts = list(accumulate(sizes, initial=0))
        self._empty = pa.table({name: [] for name in columns})
        self._decoded: tuple[int, ArrowTable] | None = None

    def __enter__(self) -> _Rows:
        return self

    def __exit__(self, *error: object) -> None:
        for file in self._files:
            file.close()

    def __len__(self) -> int:
        return self._starts[-1]

    def read(self, start: int, stop: int) -> ArrowTable:
        """Rows `start` to `stop`, exclusive."""
        pieces: list[ArrowTable] = []
        while start < stop:
            group = bisect_right(self._starts, start) - 1
            end = min(stop, self._starts[group + 1])
            pieces.append(self._group(group).slice(start - self._starts[group], end - start))
            start = end
        return pa.concat_tables(pieces) if pieces else self._empty

    def _group(self, group: int) -> ArrowTable:
        if self._decoded is None or self._decoded[0] != group:
            file, number = self._groups[group]
            self._decoded = group, file.read_row_group(number, columns=self._columns)
        return self._decoded[1]


def _labels(frames: ArrowTable, objects: ArrowTable, sensors: ArrowTable) -> Iterator[Label]:
    others = _objects([_values(objects, name) for name in _OBJECT_COLUMNS])
    egos = _objects([["ego"] * len(frames), *(_values(frames, name) for name in _EGO_COLUMNS)])
    channels = zip(_values(sensors, "channel"), _values(sensors, "path"), strict=True)
    first = 0
    columns = [_values(frames, name) for name in _LABEL_COLUMNS]
    for ego, (frame, recording, time, map_name, params, count, sensor_count) in zip(
        egos, zip(*columns, strict=True), strict=True
    ):
        paths = dict(next(channels) for _ in range(sensor_count))
        mine = tuple(others[first : first + count])
        first += count
        yield Label(frame, recording, time, map_name, ego, mine, params, paths)


def _objects(columns: list[list[Any]]) -> list[LabelObject]:
    return [
        LabelObject(
            id,
            category,
            source_class,
            x,
            y,
            heading,
            width,
            length,
            height,
            None if vx is None else (vx, vy),
            track,
            attributes,
        )
        for id, category, source_class, x, y, heading, width, length, height, vx, vy, track, attributes in zip(
            *columns, strict=True
        )
    ]


def _values(table: ArrowTable, name: str) -> list[Any]:
    """A column as Python values: null becomes None, JSON what it says; equal JSON texts share one value."""
    column: Any = table[name]
    is_json = name.endswith(("attributes", "params"))
    if pa.types.is_dictionary(column.type):
        values: list[Any] = []
        for chunk in column.chunks:
            absent = len(chunk.dictionary)
            indices = chunk.indices.fill_null(absent).to_numpy(zero_copy_only=False)
            # A slice shares the dictionary of its whole row group: decode only what it uses.
            used, places = np.unique(indices, return_inverse=True)
            texts: list[Any] = chunk.dictionary.take(used[used < absent]).to_pylist()
            distinct = [*map(json.loads, texts), {}] if is_json else [*texts, None]
            values += [distinct[place] for place in places.tolist()]
        return values
    if column.null_count == len(column):
        return [{} if is_json else None] * len(column)
    if column.null_count == 0 and pa.types.is_primitive(column.type):
        return column.to_numpy().tolist()
    return column.to_pylist()
