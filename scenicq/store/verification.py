"""Compute again what an ingest computes, and compare: the prefilter relies on it, and a stranger may have lied."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack, closing

import numpy as np
import pyarrow as pa

from scenicq.store.columns import second_of_track
from scenicq.store.dataset import Dataset
from scenicq.store.part_rows import PartRows
from scenicq.store.rebuild import recordings_of
from scenicq.store.regions import lane_rows, link_rows
from scenicq.store.rows import recording_rows
from scenicq.store.schema import SCHEMAS, SEGMENT_TABLES, ArrowArray, ArrowTable
from scenicq.store.segment import MapIndexes
from scenicq.store.validation import invalid, read_sound

__all__ = ["verify_computed"]

_CLOSE = 1e-6
"""How far numbers may be from those computed again, perhaps on another machine: metres, radians."""


def verify_computed(dataset: Dataset) -> None:
    """Compute everything again that follows from labels and maps; the dataset must be sound otherwise.

    Raises:
        DataError: dataset-invalid: a table says something else.
    """
    manifest = dataset.manifest
    maps = {name: dataset.features(name) for name in manifest.maps}
    for table, rows_of in (("lanes", lane_rows), ("links", link_rows)):
        for part, file in zip(manifest.tables[table], dataset.files(table), strict=True):
            again = [SCHEMAS[table].empty_table(), *(rows_of(name, maps[name]) for name in sorted(maps))]
            _compare(table, read_sound(table, file, part.path), pa.concat_tables(again), part.path)
    indexes = MapIndexes(maps)
    for number in range(len(manifest.tables["labels"])):
        with ExitStack() as files:
            found = {
                table: files.enter_context(closing(PartRows(table, dataset.place.file(part), part.path)))
                for table in SEGMENT_TABLES
                for part in (manifest.tables[table][number],)
            }
            _verify_part(found, indexes)


def _verify_part(found: Mapping[str, PartRows], indexes: MapIndexes) -> None:
    """Compare the tables of a part, a recording at a time, so that memory does not grow with the part."""
    first: dict[str, int] = dict.fromkeys(SEGMENT_TABLES, 0)
    for size in found["labels"].runs("recording"):
        # what labels say of objects and sensors is sound
        there = {"labels": found["labels"].take(first["labels"], size)}
        for table, name in (("objects", "object_count"), ("sensors", "sensor_count")):
            there[table] = found[table].take(first[table], int(there["labels"][name].to_numpy().sum()))
        (columns,) = recordings_of(there["labels"], there["objects"], there["sensors"])
        if (second := second_of_track(columns)) is not None:
            row = first["objects"] + second
            invalid(found["objects"].name, "has two objects of one track in a label", row=row, column="track")
        again = recording_rows(
            columns, indexes.of(columns.map), first_object=first["objects"], first_sensor=first["sensors"]
        )
        there["memberships"] = found["memberships"].take(first["memberships"], len(again["memberships"]))
        for table, rows in again.items():
            _compare(table, there[table], rows, found[table].name)
            first[table] += len(rows)
    for table, count in first.items():
        _compare_lengths(found[table].rows, count, found[table].name)


def _compare(table: str, found: ArrowTable, expected: ArrowTable, file: str) -> None:
    _compare_lengths(len(found), len(expected), file)
    for field in SCHEMAS[table]:
        told, again = (rows[field.name].combine_chunks() for rows in (found, expected))
        if not told.equals(again) and not _close(told, again):
            invalid(file, "is not what is computed from labels and maps", column=field.name)


def _compare_lengths(found: int, expected: int, file: str) -> None:
    if found != expected:
        invalid(file, f"has {found} rows, and what it is computed from makes {expected}")


def _close(told: ArrowArray, again: ArrowArray) -> bool:
    """Whether numbers, or lists of them, are as good as equal."""
    if pa.types.is_list(told.type):
        return told.value_lengths().equals(again.value_lengths()) and _close(told.flatten(), again.flatten())
    if told.type != pa.float64():
        return False
    a, b = (values.to_numpy(zero_copy_only=False) for values in (told, again))
    return bool(np.allclose(a, b, rtol=_CLOSE, atol=_CLOSE, equal_nan=True))
