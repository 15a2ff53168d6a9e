"""The labels of a dataset as columns: frames, and the label objects in them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenicq.store.dataset import Dataset
from scenicq.store.schema import ArrowArray, ArrowTable

__all__ = ["Annotations", "Frames", "read_annotations"]

Reals = NDArray[np.float64]
Numbers = NDArray[np.int32]

_UNKNOWN = "unknown"
_EGO = ("ego_x", "ego_y", "ego_heading", "ego_z", "ego_pitch", "ego_roll")
_OBJECT = ("x", "y", "heading", "width", "length", "height", "vx", "vy", "z")


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """The frames of a dataset as columns, in its order.

    Attributes:
        names: The frames' names.
        numbers: The number of each frame, by name.
        recordings: Names of the recordings.
        recording: Number of the recording of each frame, shape (n,).
        timestamp_us: When each frame was recorded, shape (n,).
        maps: Names of the maps.
        map: Number of the map of each frame, shape (n,).
        ego_x, ego_y, ego_heading: The centre of the ego, shape (n,).
        ego_z, ego_pitch, ego_roll: Its height and tilt, nan where unknown, shape (n,).
        params: Global parameters of each frame.
    """

    names: list[str]
    numbers: Mapping[str, int]
    recordings: list[str]
    recording: Numbers
    timestamp_us: NDArray[np.int64]
    maps: list[str]
    map: Numbers
    ego_x: Reals
    ego_y: Reals
    ego_heading: Reals
    ego_z: Reals
    ego_pitch: Reals
    ego_roll: Reals
    params: list[Mapping[str, Any]]


@dataclass(frozen=True, slots=True, eq=False)
class Annotations:
    """The label objects of a dataset, in the order of its frames and of the source.

    Attributes:
        ids: Identifiers, unique in a frame, as an Arrow array: a list would take three times the room.
        tracks: Identifiers of the physical object, as an Arrow array; empty where there is none.
        frame: Number of the frame, shape (n,).
        classes, source_classes: Names of classes: of the class tree, and the source's own.
        category, source_category: The class of each object, as a number in these, shape (n,).
        x, y, heading, width, length, height, vx, vy, z: As labels have them, shape (n,); nan where unknown.
        attributes: Names of attributes.
        attribute: Number of the attribute that counts, -1 without, shape (n,).
        points: How many points the source counts in the box, by the attribute that says so; -1 where it does not.
        visibility: Names of levels, in the order of `visible`.
        visible: Number of the level, shape (n,).
    """

    ids: ArrowArray
    tracks: ArrowArray
    frame: Numbers
    classes: list[str]
    category: Numbers
    source_classes: list[str]
    source_category: Numbers
    x: Reals
    y: Reals
    heading: Reals
    width: Reals
    length: Reals
    height: Reals
    vx: Reals
    vy: Reals
    z: Reals
    attributes: list[str]
    attribute: Numbers
    points: Mapping[str, Reals]
    visibility: list[str]
    visible: Numbers


def read_annotations(
    dataset: Dataset, points: tuple[str, ...] = (), groups: tuple[str, ...] = ()
) -> tuple[Frames, Annotations]:
    """Read all labels of a dataset.

    Args:
        dataset: The dataset.
        points: Attributes that count points.
        groups: Groups of attributes of which an object has one.
    """
    with dataset.blamed(), closing(dataset.connect()) as connection:
        rows = connection.sql(
            f"SELECT frame, recording, timestamp_us, map, {', '.join(_EGO)}, params FROM labels "
            "ORDER BY recording, timestamp_us, frame"
        ).to_arrow_table()
        names: list[str] = rows["frame"].to_pylist()
        recordings, recording = _codes(rows["recording"])
        maps, of_map = _codes(rows["map"])
        texts, at = _codes(rows["params"], absent="{}")
        params = [json.loads(text) for text in texts]
        frames = Frames(
            names=names,
            numbers={name: number for number, name in enumerate(names)},
            recordings=recordings,
            recording=recording,
            timestamp_us=rows["timestamp_us"].to_numpy(),
            maps=maps,
            map=of_map,
            **{name: _reals(rows[name]) for name in _EGO},
            params=[params[number] for number in at.tolist()],
        )
        connection.register("numbered", rows.select(["frame"]).append_column("number", [list(range(len(names)))]))
        objects = connection.sql(
            'SELECT n.number, o.id, o.track, o."class", o.source_class, o.x, o.y, o.heading, o.width, o.length, '
            "o.height, o.vx, o.vy, o.z, o.attributes FROM objects o JOIN numbered n ON o.frame = n.frame "
            "ORDER BY n.number, o.ordinal"
        ).to_arrow_table()
    annotations = _annotations(objects, points, groups)
    del objects
    # the pool keeps what the table took
    pa.default_memory_pool().release_unused()
    return frames, annotations


def _annotations(objects: ArrowTable, points: tuple[str, ...], groups: tuple[str, ...]) -> Annotations:
    classes, category = _codes(objects["class"])
    source_classes, source_category = _codes(objects["source_class"])
    texts, at = _codes(objects["attributes"], absent="{}")
    told: list[Mapping[str, Any]] = [json.loads(text) for text in texts]
    levels = [str(each.get("visibility", _UNKNOWN)) for each in told]
    visibility = sorted(set(levels) | {_UNKNOWN})
    order = {level: number for number, level in enumerate(visibility)}
    of_text = [next((f"{group}.{each[group]}" for group in groups if group in each), "") for each in told]
    attributes = sorted(set(of_text) - {""})
    places = {name: number for number, name in enumerate(attributes)}

    def count(name: str) -> Callable[[Mapping[str, Any]], float]:
        return lambda each: float(each.get(name, -1))

    return Annotations(
        ids=objects["id"].combine_chunks(),
        tracks=objects["track"].fill_null("").combine_chunks(),
        frame=objects["number"].to_numpy().astype(np.int32),
        classes=classes,
        category=category,
        source_classes=source_classes,
        source_category=source_category,
        **{name: _reals(objects[name]) for name in _OBJECT},
        attributes=attributes,
        attribute=np.array([places.get(name, -1) for name in of_text], dtype=np.int32)[at],
        points={name: np.array([*map(count(name), told)], dtype=np.float64)[at] for name in points},
        visibility=visibility,
        visible=np.array([order[level] for level in levels], dtype=np.int32)[at],
    )


def _codes(column: pa.ChunkedArray, absent: str = "") -> tuple[list[str], Numbers]:
    """Number texts: the distinct ones, and the number of each row's text."""
    encoded = column.fill_null(absent).combine_chunks().dictionary_encode()
    return encoded.dictionary.to_pylist(), encoded.indices.to_numpy(zero_copy_only=False).astype(np.int32)


def _reals(column: pa.ChunkedArray) -> Reals:
    return np.ascontiguousarray(column.to_numpy().astype(np.float64))
