"""Make rows of every table from the columns of one recording, with what is computed at ingest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenicq.geometry.angles import normalize_array
from scenicq.geometry.network import Network
from scenicq.number_ranges import expand_ranges
from scenicq.store.arrays import lists_at, number_array, repeated_texts
from scenicq.store.camera_rows import camera_columns
from scenicq.store.columns import OUT_OF_PLANE, MemberColumns, Memberships, RecordingColumns
from scenicq.store.ego_courses import course_columns
from scenicq.store.last_lanes import ego_and_object_tracks
from scenicq.store.motion import motion_of
from scenicq.store.schema import SCHEMAS, ArrowArray, ArrowTable

if TYPE_CHECKING:  # slow to load, and not every source has maps
    from scenicq.store.map_index import MapIndex

__all__ = ["recording_rows"]


def recording_rows(
    columns: RecordingColumns, index: MapIndex | None, *, first_object: int = 0, first_sensor: int = 0
) -> dict[str, ArrowTable]:
    """Make the rows of `labels`, `objects`, `memberships` and `sensors`.

    Args:
        columns: The recording.
        index: Its map; None where it has none.
        first_object: Number of objects before it in its part of the table `objects`.
        first_sensor: Number of rows before it in its part of the table `sensors`.
    """
    egos, objects, counts = columns.egos, columns.objects, columns.object_counts
    # Everybody, label by label, the ego first.
    ends = np.cumsum(counts)
    label_of = np.repeat(np.arange(len(counts)), counts)
    ego_at, object_at = ends - counts + np.arange(len(counts)), np.arange(len(objects.x)) + label_of + 1
    xy = np.empty((len(ego_at) + len(object_at), 2))
    xy[ego_at] = np.column_stack((egos.x, egos.y))
    xy[object_at] = np.column_stack((objects.x, objects.y))
    placed = _placed(index, xy)
    times = np.array(columns.times_us, dtype=np.int64)
    # no motion crosses a label without an ego
    passages = accumulate(int(not category) for category in egos.category)
    one_track = [f"ego {n}" if category else None for n, category in zip(passages, egos.category, strict=True)]
    last_lane, turns, section_turns = np.full(len(xy), -1), np.empty(0), np.empty(0)
    if index is not None:
        by_place = np.argsort(np.concatenate((ego_at, object_at)))
        when, headings = np.concatenate((times, times[label_of])), np.concatenate((egos.heading, objects.heading))
        headings, tracks = headings[by_place], ego_and_object_tracks(one_track, objects.track)
        last_lane = index.last_lanes(when[by_place], tracks[by_place], xy, headings, placed.near)
        turns = index.turns(xy, placed.place, headings, placed.near)
        section_turns = index.section_turns(xy, placed.place, headings, placed.near)
    return {
        "labels": _table(
            "labels",
            {
                "frame": columns.frames,
                "recording": _everywhere(columns.name, len(counts)),
                "timestamp_us": times,
                "map": _everywhere(columns.map, len(counts)),
                **{f"ego_{name}": values for name, values in _properties(egos).items()},
                **_motion("ego_", times, egos, one_track),
                "ego_road_directions": lists_at(placed.directions, placed.place[ego_at]),
                "ego_lane": _names(index, placed.lane[ego_at]),
                "ego_last_lane": _known(last_lane[ego_at]),
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
                "frame": repeated_texts(columns.frames, counts),
                "recording": _everywhere(columns.name, len(label_of)),
                "timestamp_us": times[label_of],
                "ordinal": np.arange(len(label_of)) - (ends - counts)[label_of],
                "id": objects.id,
                **_properties(objects),
                **_motion("", times[label_of], objects, objects.track),
                **_relative(egos, objects, label_of),
                **course_columns(Network("", ()) if index is None else index.network, times, egos, objects, label_of),
                "road_directions": lists_at(placed.directions, placed.place[object_at]),
                "lane": _names(index, placed.lane[object_at]),
                "last_lane": _known(last_lane[object_at]),
            },
        ),
        "memberships": _table(
            "memberships",
            _memberships(columns, index, placed, ego_at, object_at) | {"turn": turns, "section_turn": section_turns},
        ),
        "sensors": _table(
            "sensors",
            {
                "frame": repeated_texts(columns.frames, columns.sensor_counts),
                "channel": columns.channels,
                "path": columns.paths,
                **camera_columns(columns.cameras or [None] * len(columns.paths)),
            },
        ),
    }


@dataclass(frozen=True, slots=True, eq=False)
class _Placed:
    """Where everybody is.

    Attributes:
        near: Regions near each.
        lane: Number of the lane of each; -1 for none, shape (n,).
        place: Number of the place of each; who stands at the same place has the same, shape (n,).
        directions: The road's directions at each place.
    """

    near: Memberships
    lane: NDArray[np.int64]
    place: NDArray[np.intp]
    directions: Sequence[tuple[float, ...]]


def _placed(index: MapIndex | None, xy: NDArray[np.float64]) -> _Placed:
    """Ask a map about positions (n, 2), each distinct one once."""
    n = len(xy)
    if index is None:
        nobody = np.empty(0, dtype=np.int64)
        return _Placed(Memberships(nobody, nobody, np.empty(0)), np.full(n, -1), np.zeros(n, dtype=np.intp), [()])
    _, first, at = np.unique(xy.view(np.complex128)[:, 0], return_index=True, return_inverse=True)
    places = xy[first]
    near = index.memberships(places)
    counts = np.bincount(near.point, minlength=len(places))
    many = counts[at]
    point = np.repeat(np.arange(n), many)
    pair = expand_ranges((np.cumsum(counts) - counts)[at], many)
    everywhere = Memberships(point, near.feature[pair], near.distance[pair])
    return _Placed(everywhere, index.lanes(places, near)[at], at, index.road_directions(places))


def _memberships(
    columns: RecordingColumns,
    index: MapIndex | None,
    placed: _Placed,
    ego_at: NDArray[np.int64],
    object_at: NDArray[np.int64],
) -> dict[str, Any]:
    near = placed.near
    many = np.bincount(near.point, minlength=len(placed.lane))
    ids = np.empty(len(many), dtype=object)
    ids[ego_at] = "ego"
    ids[object_at] = columns.objects.id
    # those of a label are together
    before = np.append(0, np.cumsum(many))
    ends = before[np.append(ego_at[1:], len(many))] if len(ego_at) else ego_at
    return {
        "frame": repeated_texts(columns.frames, np.diff(ends, prepend=0)),
        "object": repeated_texts(ids.tolist(), many),
        "kind": pa.nulls(0, pa.string()) if index is None else index.kinds.at(near.feature),
        "region": _names(index, near.feature),
        "distance": near.distance,
    }


def _names(index: MapIndex | None, features: NDArray[np.int64]) -> ArrowArray:
    return pa.nulls(len(features), pa.string()) if index is None else index.ids.at(features)


def _known(numbers: NDArray[np.int64]) -> ArrowArray:
    """Numbers, where they are not negative."""
    return number_array(np.where(numbers < 0, np.nan, numbers), pa.float64())


def _everywhere(text: str, rows: int) -> ArrowArray:
    return repeated_texts([text], np.array([rows]))


def _table(name: str, columns: Mapping[str, Any]) -> ArrowTable:
    schema = SCHEMAS[name]
    arrays = [
        number_array(values, field.type) if isinstance(values, np.ndarray) else pa.array(values, field.type)
        for field, values in ((field, columns[field.name]) for field in schema)
    ]
    return pa.Table.from_arrays(arrays, schema=schema)


def _class_counts(categories: Sequence[str], counts: NDArray[np.int64]) -> Iterator[list[tuple[str, int]]]:
    start = 0
    for count in counts.tolist():
        yield sorted(Counter(categories[start : start + count]).items())
        start += count


def _properties(members: MemberColumns) -> dict[str, Any]:
    reals = ("x", "y", "heading", "width", "length", "height", "vx", "vy")
    texts = {"class": members.category, "source_class": members.source_class}
    texts |= {"track": members.track, "attributes": members.attributes}
    found = texts | {name: getattr(members, name) for name in reals}
    for name in OUT_OF_PLANE:
        values = getattr(members, name)
        found[name] = np.full(len(members.x), np.nan) if values is None else values
    return found


def _motion(
    prefix: str, times_us: NDArray[np.int64], members: MemberColumns, tracks: Sequence[str | None]
) -> dict[str, Any]:
    motion = motion_of(times_us, members, tracks)
    return {
        f"{prefix}motion_vx": motion.vx,
        f"{prefix}motion_vy": motion.vy,
        f"{prefix}acceleration": motion.acceleration,
        f"{prefix}yaw_rate": motion.yaw_rate,
        f"{prefix}motion_derived": motion.derived,
    }


def _relative(egos: MemberColumns, objects: MemberColumns, ego: NDArray[np.int64]) -> dict[str, Any]:
    """Positions and headings of objects in the frames of their egos, whose numbers have shape (n,)."""
    dx, dy = objects.x - egos.x[ego], objects.y - egos.y[ego]
    heading = egos.heading[ego]
    cos, sin = np.cos(heading), np.sin(heading)
    return {
        "ego_right": dx * cos + dy * sin,
        "ego_ahead": dy * cos - dx * sin,
        "ego_distance": np.hypot(dx, dy),
        "relative_heading": normalize_array(objects.heading - heading),
    }
