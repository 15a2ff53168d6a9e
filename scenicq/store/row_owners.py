"""Which rows belong together: whether the tables of a part say the same of frames and objects.

Readers take rows by number, the prefilter joins them by name; both must find the same.
"""

# pyarrow has no type stubs.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pyarrow.types as kinds
from numpy.typing import NDArray

from scenicq.geometry.angles import normalize_array
from scenicq.store.camera_rows import CAMERA_COLUMNS, camera_problem, cameras_of
from scenicq.store.schema import MEMBERSHIP_RADIUS_M, ArrowTable
from scenicq.store.validation import invalid

__all__ = ["PART_COLUMNS", "check_counts", "check_frame_index", "check_part"]

PART_COLUMNS = {
    "labels": {"frame", "recording", "timestamp_us", "map", "ego_x", "ego_y", "ego_heading", "object_count",
               "first_object", "sensor_count", "first_sensor", "class_counts"},
    "objects": {"frame", "recording", "timestamp_us", "ordinal", "id", "class", "x", "y", "heading", "ego_right",
                "ego_ahead", "ego_distance", "relative_heading"},
    "memberships": {"frame", "object", "distance"},
    "sensors": {"frame", "recording", "timestamp_us", "channel", *CAMERA_COLUMNS},
}  # fmt: skip
"""The columns of each table by which the tables of a part are compared."""

_CLOSE = 1e-6
"""How far computed columns may be from what is computed again: metres, radians."""


def check_part(tables: Mapping[str, ArrowTable], names: Mapping[str, str], maps: Collection[str]) -> None:
    """Check the tables of one part against each other.

    Args:
        tables: `labels`, `objects`, `memberships` and `sensors`, each sound by itself, with `PART_COLUMNS` at least.
        names: What their files are called.
        maps: Names of the maps that labels may refer to.

    Raises:
        DataError: dataset-invalid.
    """
    labels, file = tables["labels"], names["labels"]
    _check_order(labels, file, maps)
    owners = check_counts(tables, names)
    for table in owners:
        _check_copies(tables[table], labels, owners[table], names[table])
    _check_objects(tables["objects"], labels, owners["objects"], names["objects"])
    _check_unique(tables["sensors"], "channel", owners["sensors"], names["sensors"])
    _check_cameras(tables["sensors"], names["sensors"])
    _check_class_counts(labels, tables["objects"], owners["objects"], file)
    _check_memberships(tables, names, owners["objects"])


def check_counts(tables: Mapping[str, ArrowTable], names: Mapping[str, str]) -> dict[str, NDArray[np.int64]]:
    """Check that labels claim the rows of `objects` and `sensors` that there are, one after the other.

    Args:
        tables: `labels`, `objects` and `sensors`, each sound by itself.
        names: What their files are called.

    Returns:
        The number of the label that each row of `objects` and of `sensors` belongs to.

    Raises:
        DataError: dataset-invalid.
    """
    labels, file = tables["labels"], names["labels"]
    owners: dict[str, NDArray[np.int64]] = {}
    for table, what in (("objects", "object"), ("sensors", "sensor")):
        counts = labels[f"{what}_count"].to_numpy().astype(np.int64)
        wrong = labels[f"first_{what}"].to_numpy() != np.cumsum(counts) - counts
        _refuse(wrong, "is not where the rows before it end", file, f"first_{what}")
        if counts.sum() != len(tables[table]):
            invalid(names[table], f"has {len(tables[table])} rows, and labels claim {counts.sum()}")
        owners[table] = np.repeat(np.arange(len(labels)), counts)
    return owners


def check_frame_index(rows: ArrowTable, expected: ArrowTable, name: str) -> None:
    """Check the table of frames against the one that the labels have.

    Raises:
        DataError: dataset-invalid.
    """
    if not rows.select(expected.column_names).equals(expected):
        invalid(name, "does not say where the frames are")


def _check_order(labels: ArrowTable, file: str, maps: Collection[str]) -> None:
    recordings, times = labels["recording"].to_pylist(), labels["timestamp_us"].to_pylist()
    keys = list(zip(recordings, times, labels["frame"].to_pylist(), strict=True))
    wrong = np.array([before >= after for before, after in pairwise(keys)], dtype=bool)
    _refuse(np.append(False, wrong), "comes before the row above, or twice", file, "frame")
    found = labels["map"].to_pylist()
    strange = np.array([name not in maps for name in found], dtype=bool)
    _refuse(strange, "is no map of which the manifest knows", file, "map")
    moved = [r == s and m != n for r, s, m, n in zip(recordings, recordings[1:], found, found[1:], strict=False)]
    _refuse(np.append(False, np.array(moved, dtype=bool)), "changes within a recording", file, "map")


def _check_copies(rows: ArrowTable, labels: ArrowTable, owner: NDArray[np.int64], file: str) -> None:
    """Columns that repeat what the label says."""
    for name in ("frame", "recording"):
        if name in rows.column_names:
            numbers, texts = _coded(rows[name])
            own = _places(texts, labels[name].to_pylist())[owner]
            _refuse(numbers != own, "is not that of the label that the row belongs to", file, name)
    if "timestamp_us" in rows.column_names:
        wrong = rows["timestamp_us"].to_numpy() != labels["timestamp_us"].to_numpy()[owner]
        _refuse(wrong, "is not that of the label that the row belongs to", file, "timestamp_us")


def _check_objects(objects: ArrowTable, labels: ArrowTable, owner: NDArray[np.int64], file: str) -> None:
    counts = labels["object_count"].to_numpy().astype(np.int64)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    _refuse(objects["ordinal"].to_numpy() != place, "is not the row's number within its label", file, "ordinal")
    numbers, names = _coded(objects["id"])
    _refuse(numbers == _places(names, ["ego"])[0], "is the name of the ego", file, "id")
    _check_unique(objects, "id", owner, file)
    x, y, heading = (_reals(objects[name]) for name in ("x", "y", "heading"))
    ego_x, ego_y, ego_heading = (_reals(labels[f"ego_{name}"])[owner] for name in ("x", "y", "heading"))
    dx, dy, cos, sin = x - ego_x, y - ego_y, np.cos(ego_heading), np.sin(ego_heading)
    computed = {
        "ego_right": dx * cos + dy * sin,
        "ego_ahead": dy * cos - dx * sin,
        "ego_distance": np.hypot(dx, dy),
    }
    for name, expected in computed.items():
        _refuse(_differ(_reals(objects[name]), expected), "is not what the positions say", file, name)
    turned, found = normalize_array(heading - ego_heading), _reals(objects["relative_heading"])
    off = np.abs(np.remainder(found - turned + np.pi, 2 * np.pi) - np.pi)
    wrong = (off > _CLOSE) | (np.isnan(found) != np.isnan(turned))
    _refuse(wrong, "is not what the headings say", file, "relative_heading")


def _differ(found: NDArray[np.float64], expected: NDArray[np.float64]) -> NDArray[np.bool_]:
    off = np.abs(found - expected) > _CLOSE * np.maximum(1.0, np.abs(expected))
    return off | (np.isnan(found) != np.isnan(expected))


def _check_unique(rows: ArrowTable, column: str, owner: NDArray[np.int64], file: str) -> None:
    """Names that occur once in a label."""
    pairs = owner * max(1, len(rows)) + _coded(rows[column])[0]
    _, first = np.unique(pairs, return_index=True)
    again = np.ones(len(pairs), dtype=bool)
    again[first] = False
    _refuse(again, "occurs twice in a label", file, column)


def _check_cameras(rows: ArrowTable, file: str) -> None:
    """A sensor file has a whole camera, or nothing of one."""
    wide, high, seen, pose = CAMERA_COLUMNS
    there = ~np.isnan(_reals(rows[wide]))
    _refuse(np.isnan(_reals(rows[high])) == there, "is there without the width, or is not", file, high)
    for name, numbers in ((seen, 4), (pose, 7)):
        wrong = np.diff(rows[name].combine_chunks().offsets.to_numpy()) != np.where(there, numbers, 0)
        _refuse(wrong, f"has not the {numbers} numbers of a camera, or has numbers without one", file, name)
    for row, camera in enumerate(cameras_of(rows) if there.any() else ()):
        if camera is not None and (problem := camera_problem(camera)) is not None:
            invalid(file, problem, row)


def _check_class_counts(labels: ArrowTable, objects: ArrowTable, owner: NDArray[np.int64], file: str) -> None:
    code, names = _coded(objects["class"])
    each = max(1, len(names))
    expected = np.unique(owner * each + code, return_counts=True)
    told = labels["class_counts"].combine_chunks()
    sizes = np.diff(told.offsets.to_numpy())
    claimed = _places(names, told.keys.to_pylist())
    if (claimed < 0).any():
        invalid(file, "counts a class of which there is no object", column="class_counts")
    keys = np.repeat(np.arange(len(labels)), sizes) * each + claimed
    order = np.argsort(keys, kind="stable")
    counts = told.items.to_numpy()
    same = np.array_equal(keys[order], expected[0]) and np.array_equal(counts[order], expected[1])
    if not same:
        invalid(file, "is not how many objects of each class the labels have", column="class_counts")


def _check_memberships(tables: Mapping[str, ArrowTable], names: Mapping[str, str], owner: NDArray[np.int64]) -> None:
    rows, file = tables["memberships"], names["memberships"]
    far = rows["distance"].to_numpy() > MEMBERSHIP_RADIUS_M + _CLOSE
    _refuse(far, f"is more than {MEMBERSHIP_RADIUS_M} m", file, "distance")
    frames = tables["labels"]["frame"].to_pylist()
    numbers, texts = _coded(rows["frame"])
    label = _places(frames, texts)[numbers]
    _refuse(label < 0, "is no frame of this part", file, "frame")
    own, known = _coded(tables["objects"]["id"])
    names_of = [*known, "ego"]
    numbers, texts = _coded(rows["object"])
    code = _places(names_of, texts)[numbers]
    _refuse(code < 0, "is no object of this part", file, "object")
    many = len(names_of)
    there = np.concatenate((owner * many + own, np.arange(len(frames)) * many + many - 1))
    pairs = label * many + code
    first = np.append(True, pairs[1:] != pairs[:-1])[: len(pairs)]  # rows of one object follow each other
    wrong = np.zeros(len(pairs), dtype=bool)
    wrong[first] = ~np.isin(pairs[first], there)
    _refuse(wrong, "is not in the frame", file, "object")


def _coded(column: Any) -> tuple[NDArray[np.int64], list[str]]:
    """Texts as numbers, equal for equal ones, and the text of each number."""
    values = column.combine_chunks()
    coded = values if kinds.is_dictionary(values.type) else values.dictionary_encode()
    return coded.indices.to_numpy(zero_copy_only=False).astype(np.int64), coded.dictionary.to_pylist()


def _places(texts: Sequence[str], asked: Iterable[str]) -> NDArray[np.int64]:
    """Where each of some texts is among others, -1 where it is not there."""
    place = {text: number for number, text in enumerate(texts)}
    return np.fromiter((place.get(text, -1) for text in asked), np.int64)


def _reals(column: Any) -> NDArray[np.float64]:
    """Null becomes nan."""
    return column.to_numpy().astype(np.float64)


def _refuse(wrong: NDArray[np.bool_], what: str, file: str, column: str) -> None:
    """Refuse the first row where something is true."""
    if wrong.any():
        invalid(file, what, int(np.argmax(wrong)), column)
