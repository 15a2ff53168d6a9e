"""From the labels of one recording to rows of every table, with what is computed at ingest."""

# pyarrow has no type stubs.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenicq.geometry.angles import normalize_array
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.placement import MapIndex
from scenicq.store.schema import SCHEMAS, ArrowTable

__all__ = ["recording_rows"]


_encode = json.JSONEncoder(ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode


def recording_rows(recording: Recording, index: MapIndex) -> dict[str, ArrowTable]:
    """Rows of `labels`, `objects`, `memberships` and `sensors`.

    Args:
        recording: Its labels in order of time, then of frame.
        index: Its map.
    """
    labels = recording.labels
    everyone = [member for label in labels for member in (label.ego, *label.objects)]
    frame_of = [label.frame for label in labels for _ in range(1 + len(label.objects))]
    xy = np.array([(member.x, member.y) for member in everyone], dtype=np.float64).reshape(-1, 2)
    near = index.memberships(xy)
    placed = {"lane": index.lanes(xy, near), "road_directions": index.road_directions(xy)}
    is_ego = np.array([member.id == "ego" for member in everyone], dtype=bool)
    ego_of = np.cumsum(is_ego) - 1
    return {
        "labels": _label_rows(labels, {name: _picked(values, is_ego) for name, values in placed.items()}),
        "objects": _object_rows(
            [label for label in labels for _ in label.objects],
            [number for label in labels for number in range(len(label.objects))],
            _picked(everyone, ~is_ego),
            {name: _picked(values, ~is_ego) for name, values in placed.items()}
            | _relative(xy, everyone, np.flatnonzero(is_ego)[ego_of], ~is_ego),
        ),
        "memberships": pa.table(
            {
                "frame": [frame_of[point] for point in near.point.tolist()],
                "object": [everyone[point].id for point in near.point.tolist()],
                "kind": [index.kinds[feature] for feature in near.feature.tolist()],
                "region": [index.ids[feature] for feature in near.feature.tolist()],
                "distance": near.distance,
            },
            schema=SCHEMAS["memberships"],
        ),
        "sensors": _table(
            "sensors",
            {
                "frame": [label.frame for label in labels for _ in label.sensors],
                "channel": [channel for label in labels for channel in label.sensors],
                "path": [path for label in labels for path in label.sensors.values()],
            },
        ),
    }


def _table(name: str, columns: Mapping[str, Any]) -> ArrowTable:
    return pa.table(dict(columns), schema=SCHEMAS[name])


def _picked(values: Sequence[Any], mask: NDArray[np.bool_]) -> list[Any]:
    return [values[number] for number in np.flatnonzero(mask).tolist()]


def _label_rows(labels: Sequence[Label], placed: Mapping[str, list[Any]]) -> ArrowTable:
    egos = _member_columns([label.ego for label in labels])
    counts = [Counter(member.category for member in label.objects) for label in labels]
    return _table(
        "labels",
        {
            "frame": [label.frame for label in labels],
            "recording": [label.recording for label in labels],
            "timestamp_us": [label.timestamp_us for label in labels],
            "map": [label.map for label in labels],
            **{f"ego_{name}": values for name, values in {**egos, **placed}.items()},
            "params": [_to_json(label.params) for label in labels],
            "object_count": [len(label.objects) for label in labels],
            "sensor_count": [len(label.sensors) for label in labels],
            "class_counts": [sorted(count.items()) for count in counts],
        },
    )


def _object_rows(
    labels: Sequence[Label], ordinals: list[int], objects: Sequence[LabelObject], computed: Mapping[str, Any]
) -> ArrowTable:
    return _table(
        "objects",
        {
            "frame": [label.frame for label in labels],
            "recording": [label.recording for label in labels],
            "timestamp_us": [label.timestamp_us for label in labels],
            "ordinal": ordinals,
            "id": [member.id for member in objects],
            **_member_columns(objects),
            **computed,
        },
    )


def _member_columns(members: Sequence[LabelObject]) -> dict[str, list[Any]]:
    return {
        "class": [member.category for member in members],
        "source_class": [member.source_class for member in members],
        "x": [member.x for member in members],
        "y": [member.y for member in members],
        "heading": [member.heading for member in members],
        "width": [member.width for member in members],
        "length": [member.length for member in members],
        "height": [member.height for member in members],
        "vx": [None if member.velocity is None else member.velocity[0] for member in members],
        "vy": [None if member.velocity is None else member.velocity[1] for member in members],
        "track": [member.track for member in members],
        "attributes": [_to_json(member.attributes) for member in members],
    }


def _relative(
    xy: NDArray[np.float64], members: Sequence[LabelObject], ego: NDArray[np.int64], wanted: NDArray[np.bool_]
) -> dict[str, Any]:
    """Positions and headings of the wanted members in their egos' frames.

    Args:
        xy: Positions of all members, shape (n, 2).
        members: All members.
        ego: Number of each member's ego, shape (n,).
        wanted: Shape (n,).
    """
    heading = np.array([np.nan if member.heading is None else member.heading for member in members])
    offset = (xy - xy[ego])[wanted]
    cos, sin = np.cos(heading[ego])[wanted], np.sin(heading[ego])[wanted]
    turned = normalize_array((heading - heading[ego])[wanted])
    return {
        "ego_right": pa.array(offset[:, 0] * cos + offset[:, 1] * sin, from_pandas=True),
        "ego_ahead": pa.array(offset[:, 1] * cos - offset[:, 0] * sin, from_pandas=True),
        "ego_distance": pa.array(np.hypot(offset[:, 0], offset[:, 1])),
        "relative_heading": pa.array(turned, from_pandas=True),
    }


def _to_json(values: Mapping[str, Any]) -> str | None:
    if not values:
        return None
    return _encode(dict(values))
