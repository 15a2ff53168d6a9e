"""Frames of a dataset as ASAM OpenLABEL 1.0: a file a recording, a tag a match, the role of each object.

The frame of reference is the map's. It has no height, so boxes have z = 0 at their centre. An object whose size or
heading is not known has no box, but a position and what is known of the rest. Maps have no place in the format.
The keys are those that the published schema demands.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scenicq.errors import Diagnostic
from scenicq.exporters.export_record import MatchedFrame
from scenicq.store.dataset import Dataset
from scenicq.store.labels import Label, LabelObject

__all__ = ["write_openlabel"]

_MAP = "map"
_LONGEST_NAME = 200
"""Bytes of a recording's name in that of its file; systems take 255 in all."""
_UUID = re.compile("[0-9a-fA-F]{8}(-[0-9a-fA-F]{4}){3}-[0-9a-fA-F]{12}")
"""What an object may be called by, besides a whole number: other names of tracks are its `name` only."""


def write_openlabel(
    dataset: Dataset, matched: Mapping[str, MatchedFrame], folder: Path, scenario: str
) -> list[Diagnostic]:
    """Write matching frames.

    Args:
        dataset: Where they are from.
        matched: The frames by name.
        folder: An empty folder.
        scenario: What the tags call the scenario.

    Returns:
        Warnings about what the format cannot hold.
    """
    boxless = 0
    maps: set[str] = set()
    labels: list[Label] = []
    number = 0
    for label in dataset.labels(matched):
        if labels and labels[0].recording != label.recording:
            _write(folder, number, labels, matched, scenario)
            labels, number = [], number + 1
        labels.append(label)
        boxless += sum(_box(member) is None for member in _members(label))
        maps.add(label.map)
    if labels:
        _write(folder, number, labels, matched, scenario)
    left_out = [f"{boxless} objects have no box: a size or the heading is not known"] if boxless else []
    if mapped := [name for name in sorted(maps) if dataset.features(name)]:
        left_out.append(f"maps are left out, which the format does not hold: {', '.join(mapped)}")
    return [Diagnostic("record-invalid", message, severity="warning") for message in left_out]


def _members(label: Label) -> tuple[LabelObject, ...]:
    return (label.ego, *label.objects) if label.has_ego else label.objects


def _write(folder: Path, number: int, labels: list[Label], matched: Mapping[str, MatchedFrame], scenario: str) -> None:
    keys: dict[str, str] = {}
    objects: dict[str, dict[str, Any]] = {}
    frames: dict[str, Any] = {}
    tags: dict[str, Any] = {}
    for index, label in enumerate(labels):
        roles: dict[str, list[str]] = {}
        for role, member in matched[label.frame].roles.items():
            roles.setdefault(member, []).append(role)
        members: dict[str, Any] = {}
        for member in _members(label):
            name = member.track or member.id if member.id != "ego" else "ego"
            key = keys.setdefault(name, name if _UUID.fullmatch(name) else str(len(keys)))
            objects.setdefault(key, {"name": name, "type": member.category})
            members[key] = {"object_data": _data(member, roles.get(member.id, []))}
        properties: dict[str, Any] = {"timestamp": f"{label.timestamp_us / 1e6:.6f}", "frame_id": label.frame}
        if label.sensors:
            properties["streams"] = {channel: {"uri": path} for channel, path in label.sensors.items()}
        frames[str(index)] = {"objects": members, "frame_properties": properties}
        texts = {"scenario": scenario, "frame": label.frame, "recording": label.recording, "map": label.map}
        told = _values(label.params)
        tags[str(index)] = {
            "type": "ScenarioMatch",
            "ontology_uid": "0",
            "tag_data": {
                **told,
                "text": [*({"name": name, "val": value} for name, value in texts.items()), *told.get("text", ())],
                "num": [{"name": "frame_index", "val": index}, *told.get("num", ())],
            },
        }
    content: dict[str, Any] = {
        "openlabel": {
            "metadata": {"schema_version": "1.0.0", "name": labels[0].recording, "annotator": "scenicq"},
            "ontologies": {"0": "scenicq"},
            "coordinate_systems": {_MAP: {"type": "scene_cs", "parent": "", "children": []}},
            "objects": objects,
            "frames": frames,
            "frame_intervals": [{"frame_start": 0, "frame_end": len(labels) - 1}],
            "tags": tags,
        }
    }
    safe = "".join(char if char.isalnum() or char in "-_" else "_" for char in labels[0].recording)
    # a system counts bytes, of which one character may have four, and may know ASCII alone
    encoding = sys.getfilesystemencoding()
    safe = safe.encode(encoding, "replace").replace(b"?", b"_")[:_LONGEST_NAME].decode(encoding, "ignore")
    file = folder / f"{number:05d}_{safe}.json"
    file.write_text(json.dumps(content, ensure_ascii=False, indent=1) + "\n", encoding="utf-8")


def _data(member: LabelObject, roles: list[str]) -> dict[str, Any]:
    texts = [{"name": "role", "val": role} for role in roles]
    texts.append({"name": "source_class", "val": member.source_class})
    data: dict[str, Any] = _values(member.attributes)
    data["vec"] = [{"name": "position", "val": [member.x, member.y], "coordinate_system": _MAP}]
    data["text"] = texts + data.get("text", [])
    if member.velocity is not None:
        data["vec"].append({"name": "velocity", "val": list(member.velocity), "coordinate_system": _MAP})
    if (box := _box(member)) is not None:
        data["cuboid"] = [{"name": "box", "val": box, "coordinate_system": _MAP}]
        return data
    known = {"yaw": _yaw(member), "length": member.length, "width": member.width, "height": member.height}
    numbers = [{"name": name, "val": value} for name, value in known.items() if value is not None]
    if numbers:
        data["num"] = numbers + data.get("num", [])
    return data


def _yaw(member: LabelObject) -> float | None:
    """Counted from +x, as the format does."""
    return None if member.heading is None else math.remainder(member.heading + math.pi / 2, 2 * math.pi)


def _box(member: LabelObject) -> list[float] | None:
    """Centre, rotations and extents along the box's own axes; None where one is not known."""
    yaw, length, width, height = _yaw(member), member.length, member.width, member.height
    if yaw is None or length is None or width is None or height is None:
        return None
    return [member.x, member.y, 0.0, 0.0, 0.0, yaw, length, width, height]


def _values(values: Mapping[str, str | float | bool]) -> dict[str, list[dict[str, Any]]]:
    """Named values by the kinds that the format has."""
    found: dict[str, list[dict[str, Any]]] = {}
    for name, value in values.items():
        kind = "text" if isinstance(value, str) else "boolean" if isinstance(value, bool) else "num"
        found.setdefault(kind, []).append({"name": name, "val": value})
    return found
