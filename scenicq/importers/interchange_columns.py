"""Lines of an interchange folder by column: fast, and only for recordings in which everything is sound.

Whatever is unsound, or unusual enough that the two readers might differ, makes the answer None; `interchange` then
reads the recording label by label, which tells what is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import chain, repeat
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.angles import normalize_array
from scenicq.importers.fields import InvalidError, parse_json
from scenicq.store.columns import MemberColumns, RecordingColumns, to_json

__all__ = ["read_columns"]

_LARGEST = 2**63 - 1
_GET = cast("Callable[[dict[str, Any], str], Any]", dict[str, Any].get)
_SCALARS = frozenset((str, bool, int, float))


class _UnusualError(Exception):
    """The columns cannot be made here."""


def read_columns(
    lines: Sequence[bytes], recording: str, classes: Mapping[str, str], *, yaw: bool
) -> RecordingColumns | None:
    """The columns of a recording.

    Args:
        lines: JSON, one label each.
        recording: Its name.
        classes: Class of the tree for each class name.
        yaw: Whether angles are counted from +x.

    Returns:
        None if anything is not as it should be.
    """
    try:
        return _columns([_label(parse_json(line), recording) for line in lines], recording, classes, yaw=yaw)
    except (InvalidError, _UnusualError, OverflowError, TypeError, ValueError):
        return None


def _columns(
    labels: list[dict[str, Any]], recording: str, classes: Mapping[str, str], *, yaw: bool
) -> RecordingColumns:
    labels.sort(key=lambda label: (label["timestamp_us"], label["id"]))
    times = [label["timestamp_us"] for label in labels]
    maps = {label["map"] for label in labels}
    _demand(len(set(times)) == len(times) and len(maps) == 1)
    lists: list[list[Any]] = [label["objects"] for label in labels]
    sensors: list[dict[str, Any]] = [label.get("sensors") or {} for label in labels]
    paths = [path for paths in sensors for path in paths.values()]
    _demand(all(type(path) is str and path for path in paths))
    egos, objects = [label["ego"] for label in labels], list(chain.from_iterable(lists))
    _demand(_are(objects, dict))
    ids = _all(objects, "id")
    _demand(_are(ids, str) and {"", "ego"}.isdisjoint(ids))
    start = 0
    for entries in lists:
        _demand(len(set(ids[start : start + len(entries)])) == len(entries))
        start += len(entries)
    names = _all(objects, "class")
    _demand(set(map(type, names)) <= {str} and all(name and name in classes for name in set(names)))
    ego_names = [entry.get("class") for entry in egos]
    _demand(all(name in (None, "") or (type(name) is str and name in classes) for name in ego_names))
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
    )


def _demand(sound: bool) -> None:
    if not sound:
        raise _UnusualError


def _label(content: object, recording: str) -> dict[str, Any]:
    """A line, whose own fields are of the right types."""
    _demand(type(content) is dict)
    line = cast(dict[str, Any], content)
    time = line.get("timestamp_us")
    _demand(
        line.get("recording") == recording
        and type(time) is int
        and abs(time) <= _LARGEST
        and all(type(line.get(key)) is str and line[key] != "" for key in ("id", "recording", "map"))
        and type(line.get("objects")) is list
        and type(line.get("ego")) is dict
        and isinstance(line.get("sensors"), dict | None)
    )
    return line


def _members(
    entries: Sequence[dict[str, Any]], ids: Sequence[str], category: Sequence[str], names: Sequence[str], *, yaw: bool
) -> MemberColumns:
    places = _all(entries, "position")
    _demand(_are(places, list) and set(map(len, places)) <= {2})
    xy = _reals(list(chain.from_iterable(places))).reshape(-1, 2)
    key = "yaw" if yaw else "heading"
    headings = _all(entries, key)
    _demand(None not in headings or all(key in entry for entry in entries))
    angles = _optional_reals(headings)
    turn = -math.pi / 2 if yaw else 0.0
    velocities = _all(entries, "velocity")
    _demand(_are(velocities, list, type(None)))
    known = [velocity for velocity in velocities if velocity is not None]
    _demand(set(map(len, known)) <= {2})
    vxy = np.full((len(velocities), 2), math.nan)
    moving = [velocity is not None for velocity in velocities]
    vxy[np.array(moving, dtype=bool)] = _reals(list(chain.from_iterable(known))).reshape(-1, 2)
    tracks = _all(entries, "track")
    _demand(_are(tracks, str, type(None)))
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
        attributes=_json(_all(entries, "attributes")),
    )


def _all(entries: Sequence[dict[str, Any]], key: str) -> list[Any]:
    """The values of a key, None where an entry lacks it; not as a comprehension, which takes twice as long."""
    return list(map(_GET, entries, repeat(key)))


def _are(values: Sequence[Any], *types: type) -> bool:
    """Whether the values are exactly of some types."""
    return set(map(type, values)).issubset(types)


def _sizes(entries: Sequence[dict[str, Any]], key: str) -> NDArray[np.float64]:
    values = _optional_reals(_all(entries, key))
    _demand(not np.any(values <= 0))
    return values


def _reals(values: list[Any]) -> NDArray[np.float64]:
    _demand(_are(values, float, int))
    reals = np.array(values, dtype=np.float64)
    _demand(bool(np.isfinite(reals).all()))
    return reals


def _optional_reals(values: list[Any]) -> NDArray[np.float64]:
    _demand(_are(values, float, int, type(None)))
    reals = np.array(values, dtype=np.float64)  # None becomes nan
    _demand(int(np.isfinite(reals).sum()) == len(values) - values.count(None))
    return reals


def _json(values: Sequence[Any]) -> list[str | None]:
    texts: list[str | None] = []
    if _are(values, type(None)):
        return [None] * len(values)
    for value in values:
        if value is None:
            texts.append(None)
            continue
        _demand(type(value) is dict and _SCALARS.issuperset(map(type, value.values())))
        texts.append(to_json(value))  # refuses what is not finite
    return texts
