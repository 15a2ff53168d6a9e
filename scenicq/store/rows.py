"""From the columns of one recording to rows of every table, with what is computed at ingest."""

# pyarrow has no type stubs.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenicq.geometry.angles import normalize_array
from scenicq.store.columns import MemberColumns, RecordingColumns
from scenicq.store.placement import MapIndex, Memberships
from scenicq.store.schema import SCHEMAS, ArrowArray, ArrowTable

__all__ = ["recording_rows"]


def recording_rows(
    columns: RecordingColumns, index: MapIndex, *, first_object: int = 0, first_sensor: int = 0
) -> dict[str, ArrowTable]:
    """Rows of `labels`, `objects`, `memberships` and `sensors`.

    Args:
        columns: The recording.
        index: Its map.
        first_object: Number of objects before it in its part of the table `objects`.
        first_sensor: Number of rows before it in its part of the table `sensors`.
    """
    egos, objects, counts = columns.egos, columns.objects, columns.object_counts
    # Everybody, label by label, the ego first.
    ends = np.cumsum(counts)
    ego_at = ends - counts + np.arange(len(counts))
    label_of = np.repeat(np.arange(len(counts)), counts)
    object_at = np.arange(len(objects.x)) + label_of + 1
    xy = np.empty((len(ego_at) + len(object_at), 2))
    xy[ego_at] = np.column_stack((egos.x, egos.y))
    xy[object_at] = np.column_stack((objects.x, objects.y))
    near, lanes, directions = _placed(index, xy)
    frames, labels = pa.array(columns.frames, pa.string()), pa.array(label_of)
    everyone = np.repeat(np.arange(len(counts)), counts + 1)
    ids = np.empty(len(xy), dtype=object)
    ids[ego_at] = "ego"
    ids[object_at] = objects.id
    return {
        "labels": _table(
            "labels",
            {
                "frame": frames,
                "recording": pa.repeat(columns.name, len(frames)),
                "timestamp_us": columns.times_us,
                "map": pa.repeat(columns.map, len(frames)),
                **{f"ego_{name}": values for name, values in _properties(egos).items()},
                "ego_road_directions": directions.take(pa.array(ego_at)),
                "ego_lane": lanes.take(pa.array(ego_at)),
                "params": columns.params,
                "object_count": counts,
                "first_object": first_object + ends - counts,
                "sensor_count": columns.sensor_counts,
                "first_sensor": first_sensor + np.cumsum(columns.sensor_counts) - columns.sensor_counts,
                "class_counts": list(_class_counts(objects.category, counts)),
            },
        ),
        "objects": _table(
            "objects",
            {
                "frame": frames.take(labels),
                "recording": pa.repeat(columns.name, len(label_of)),
                "timestamp_us": pa.array(columns.times_us, pa.int64()).take(labels),
                "ordinal": np.arange(len(label_of)) - (ends - counts)[label_of],
                "id": objects.id,
                **_properties(objects),
                **_relative(egos, objects, label_of),
                "road_directions": directions.take(pa.array(object_at)),
                "lane": lanes.take(pa.array(object_at)),
            },
        ),
        "memberships": _table(
            "memberships",
            {
                "frame": frames.take(pa.array(everyone[near.point])),
                "object": pa.array(ids, pa.string()).take(pa.array(near.point)),
                "kind": pa.array(index.kinds, pa.string()).take(pa.array(near.feature)),
                "region": pa.array(index.ids, pa.string()).take(pa.array(near.feature)),
                "distance": near.distance,
            },
        ),
        "sensors": _table(
            "sensors",
            {
                "frame": frames.take(pa.array(np.repeat(np.arange(len(counts)), columns.sensor_counts))),
                "channel": columns.channels,
                "path": columns.paths,
            },
        ),
    }


def _placed(index: MapIndex, xy: NDArray[np.float64]) -> tuple[Memberships, ArrowArray, ArrowArray]:
    """Regions near positions (n, 2), lanes and directions of the road: once for all who stand at the same place."""
    _, first, at = np.unique(xy.view(np.complex128)[:, 0], return_index=True, return_inverse=True)
    places = xy[first]
    near, take = index.memberships(places), pa.array(at)
    lanes, directions = index.lanes(places, near).take(take), index.road_directions(places).take(take)
    counts = np.bincount(near.point, minlength=len(places))
    many = counts[at]
    point = np.repeat(np.arange(len(xy)), many)
    pair = np.arange(len(point)) + np.repeat((np.cumsum(counts) - counts)[at] - (np.cumsum(many) - many), many)
    return Memberships(point, near.feature[pair], near.distance[pair]), lanes, directions


def _table(name: str, columns: Mapping[str, Any]) -> ArrowTable:
    return pa.table(dict(columns), schema=SCHEMAS[name])


def _class_counts(categories: Sequence[str], counts: NDArray[np.int64]) -> Iterator[list[tuple[str, int]]]:
    start = 0
    for count in counts.tolist():
        yield sorted(Counter(categories[start : start + count]).items())
        start += count


def _properties(members: MemberColumns) -> dict[str, Any]:
    reals = ("x", "y", "heading", "width", "length", "height", "vx", "vy")
    texts = {"class": members.category, "source_class": members.source_class}
    texts |= {"track": members.track, "attributes": members.attributes}
    return texts | {name: pa.array(getattr(members, name), from_pandas=True) for name in reals}


def _relative(egos: MemberColumns, objects: MemberColumns, ego: NDArray[np.int64]) -> dict[str, Any]:
    """Positions and headings of objects in the frames of their egos, whose numbers have shape (n,)."""
    dx, dy = objects.x - egos.x[ego], objects.y - egos.y[ego]
    heading = egos.heading[ego]
    cos, sin = np.cos(heading), np.sin(heading)
    return {
        "ego_right": pa.array(dx * cos + dy * sin, from_pandas=True),
        "ego_ahead": pa.array(dy * cos - dx * sin, from_pandas=True),
        "ego_distance": pa.array(np.hypot(dx, dy)),
        "relative_heading": pa.array(normalize_array(objects.heading - heading), from_pandas=True),
    }
