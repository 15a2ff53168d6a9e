"""Frames of a dataset as ASAM OpenLABEL 1.0: a file a recording, a tag a match, the role of each object.

The frame of reference is the map's. It has no height, so boxes have z = 0 at their centre; an object whose size or
heading is not known has a position and no box.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scenicq.errors import Diagnostic
from scenicq.query.matched import Matched
from scenicq.store.dataset import Dataset
from scenicq.store.labels import Label, LabelObject

__all__ = ["write_openlabel"]

_MAP = "map"


def write_openlabel(dataset: Dataset, matched: Mapping[str, Matched], folder: Path, scenario: str) -> list[Diagnostic]:
    """Write matching frames.

    Args:
        dataset: Where they are from.
        matched: The frames by name.
        folder: An empty folder.
        scenario: What the tags call the scenario.

    Returns:
        Warnings about what the format cannot hold; none so far.
    """
    labels: list[Label] = []
    number = 0
    for label in dataset.labels(matched):
        if labels and labels[0].recording != label.recording:
            _write(folder, number, labels, matched, scenario)
            labels, number = [], number + 1
        labels.append(label)
    if labels:
        _write(folder, number, labels, matched, scenario)
    return []


def _write(folder: Path, number: int, labels: list[Label], matched: Mapping[str, Matched], scenario: str) -> None:
    objects: dict[str, dict[str, Any]] = {}
    frames: dict[str, Any] = {}
    tags: dict[str, Any] = {}
    for index, label in enumerate(labels):
        roles: dict[str, list[str]] = {}
        for role, member in matched[label.frame].roles.items():
            roles.setdefault(member, []).append(role)
        members: dict[str, Any] = {}
        for member in (label.ego, *label.objects):
            key = member.track or member.id if member.id != "ego" else "ego"
            objects.setdefault(key, {"name": key, "type": member.category})
            members[key] = {"object_data": _data(member, roles.get(member.id, []))}
        frames[str(index)] = {
            "objects": members,
            "frame_properties": {"timestamp": f"{label.timestamp_us / 1e6:.6f}", "frame_id": label.frame},
        }
        texts = {"scenario": scenario, "frame": label.frame, "recording": label.recording, "map": label.map}
        tags[str(index)] = {
            "type": "ScenarioMatch",
            "ontology_uid": "0",
            "tag_data": {
                "text": [{"name": name, "val": value} for name, value in texts.items()],
                "num": [{"name": "frame_index", "val": index}],
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
    safe = "".join(char if char.isalnum() or char in "-_" else "_" for char in labels[0].recording)[:100]
    file = folder / f"{number:05d}_{safe}.json"
    file.write_text(json.dumps(content, ensure_ascii=False, indent=1) + "\n", encoding="utf-8")


def _data(member: LabelObject, roles: list[str]) -> dict[str, Any]:
    texts = [{"name": "role", "val": role} for role in roles]
    texts.append({"name": "source_class", "val": member.source_class})
    data: dict[str, Any] = {
        "vec": [{"name": "position", "val": [member.x, member.y], "coordinate_system": _MAP}],
        "text": texts,
    }
    if member.velocity is not None:
        data["vec"].append({"name": "velocity", "val": list(member.velocity), "coordinate_system": _MAP})
    sizes = (member.length, member.width, member.height)
    if member.heading is not None and all(size is not None for size in sizes):
        yaw = math.remainder(member.heading + math.pi / 2, 2 * math.pi)
        value = [member.x, member.y, 0.0, 0.0, 0.0, yaw, *sizes]
        data["cuboid"] = [{"name": "box", "val": value, "coordinate_system": _MAP}]
    return data
