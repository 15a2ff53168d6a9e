"""Lines of an interchange folder by column: fast, and only for recordings in which everything is sound.

Whatever is unsound, or unusual enough that the two readers might differ, makes the answer None; `interchange` then
reads the recording label by label, which tells what is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.angles import normalize_array
from scenicq.importers.cameras import camera_of
from scenicq.importers.fields import NO_MAP, InvalidError
from scenicq.importers.sound_columns import UNUSUAL, are, column, demand, vectors
from scenicq.store.columns import MemberColumns, RecordingColumns, to_json
from scenicq.store.wkb import FARTHEST_M

__all__ = ["read_columns"]

_LARGEST = 2**63 - 1
_SCALARS = frozenset((str, bool, int, float))


def read_columns(
    lines: Sequence[object], recording: str, classes: Mapping[str, str], *, yaw: bool
) -> RecordingColumns | None:
    """The columns of a recording.

    Args:
        lines: What JSON says, one label each.
        recording: Its name.
        classes: Class of the tree for each class name.
        yaw: Whether angles are counted from +x.

    Returns:
        None if anything is not as it should be.
    """
    try:
        return _columns([_label(line, recording) for line in lines], recording, classes, yaw=yaw)
    except (InvalidError, *UNUSUAL):
        return None


def _columns(
    labels: list[dict[str, Any]], recording: str, classes: Mapping[str, str], *, yaw: bool
) -> RecordingColumns:
    labels.sort(key=lambda label: (label["timestamp_us"], label["id"]))
    times = [label["timestamp_us"] for label in labels]
    maps = {NO_MAP if label.get("map") is None else label["map"] for label in labels}
    demand(len(set(times)) == len(times) and len(maps) == 1)
    lists: list[list[Any]] = [label["objects"] for label in labels]
    sensors: list[dict[str, Any]] = [label.get("sensors") or {} for label in labels]
    files = [file for files in sensors for file in files.values()]
    cameras = [cast(dict[str, Any], file) if type(file) is dict else None for file in files]
    paths: list[Any] = [camera.get("path") if camera else file for file, camera in zip(files, cameras, strict=True)]
    demand(all(type(path) is str and path for path in paths))
    egos, objects = [label["ego"] for label in labels], list(chain.from_iterable(lists))
    demand(are(objects, dict))
    ids = column(objects, "id")
    demand(are(ids, str) and {"", "ego"}.isdisjoint(ids))
    start = 0
    for entries in lists:
        demand(len(set(ids[start : start + len(entries)])) == len(entries))
        start += len(entries)
    names = column(objects, "class")
    demand(set(map(type, names)) <= {str} and all(name and name in classes for name in set(names)))
    ego_names = [entry.get("class") for entry in egos]
    demand(all(name in (None, "") or (type(name) is str and name in classes) for name in ego_names))
    return RecordingColumns(
        name=recording,
        map=maps.pop(),
        frames=[label["id"] for label in labels],
        times_us=times,
        params=_json([label.get("params") for label in labels]),
        egos=_members(
            egos,
            ["ego"] * len(egos),
            [classes[name] if name else "Car" for name in ego_names],
            [name or "" for name in ego_names],
            yaw=yaw,
        ),
        objects=_members(objects, ids, [classes[name] for name in names], names, yaw=yaw),
        object_counts=np.array([len(entries) for entries in lists], dtype=np.int64),
        sensor_counts=np.array([len(channels) for channels in sensors], dtype=np.int64),
        channels=[channel for channels in sensors for channel in channels],
        paths=paths,
        cameras=[None if camera is None else camera_of(camera) for camera in cameras],
    )


def _label(content: object, recording: str) -> dict[str, Any]:
    """A line, whose own fields are of the right types."""
    demand(type(content) is dict)
    line = cast(dict[str, Any], content)
    time = line.get("timestamp_us")
    demand(
        line.get("recording") == recording
        and type(time) is int
        and abs(time) <= _LARGEST
        and all(type(line.get(key)) is str and line[key] != "" for key in ("id", "recording"))
        and (line.get("map") is None or (type(line["map"]) is str and line["map"] != ""))
        and type(line.get("objects")) is list
        and type(line.get("ego")) is dict
        and isinstance(line.get("sensors"), dict | None)
    )
    return line


def _members(
    entries: Sequence[dict[str, Any]], ids: Sequence[str], category: Sequence[str], names: Sequence[str], *, yaw: bool
) -> MemberColumns:
    xy = vectors(column(entries, "position"), 2)
    key = "yaw" if yaw else "heading"
    headings = column(entries, key)
    demand(None not in headings or all(key in entry for entry in entries))
    angles = _optional_reals(headings)
    turn = -math.pi / 2 if yaw else 0.0
    velocities = column(entries, "velocity")
    known = [velocity for velocity in velocities if velocity is not None]
    vxy = np.full((len(velocities), 2), math.nan)
    moving = [velocity is not None for velocity in velocities]
    vxy[np.array(moving, dtype=bool)] = vectors(known, 2)
    tracks = column(entries, "track")
    demand(are(tracks, str, type(None)))
    return MemberColumns(
        id=ids,
        category=category,
        source_class=names,
        x=np.ascontiguousarray(xy[:, 0]),
        y=np.ascontiguousarray(xy[:, 1]),
        heading=normalize_array(angles + turn),
        width=_sizes(entries, "width"),
        length=_sizes(entries, "length"),
        height=_sizes(entries, "height"),
        vx=np.ascontiguousarray(vxy[:, 0]),
        vy=np.ascontiguousarray(vxy[:, 1]),
        track=[track or None for track in tracks],
        attributes=_json(column(entries, "attributes")),
        z=_heights(entries),
        pitch=normalize_array(_optional_reals(column(entries, "pitch"))),
        roll=normalize_array(_optional_reals(column(entries, "roll"))),
    )


def _heights(entries: Sequence[dict[str, Any]]) -> NDArray[np.float64]:
    values = _optional_reals(column(entries, "z"))
    demand(not np.any(np.abs(values) > FARTHEST_M))
    return values


def _sizes(entries: Sequence[dict[str, Any]], key: str) -> NDArray[np.float64]:
    values = _optional_reals(column(entries, key))
    demand(not np.any(values <= 0))
    return values


def _optional_reals(values: list[Any]) -> NDArray[np.float64]:
    demand(are(values, float, int, type(None)))
    found = np.array(values, dtype=np.float64)  # None becomes nan
    demand(int(np.isfinite(found).sum()) == len(values) - values.count(None))
    return found


def _json(values: Sequence[Any]) -> list[str | None]:
    texts: list[str | None] = []
    if are(values, type(None)):
        return [None] * len(values)
    for value in values:
        if value is None:
            texts.append(None)
            continue
        demand(type(value) is dict and _SCALARS.issuperset(map(type, value.values())))
        texts.append(to_json(value))  # refuses what is not finite
    return texts
