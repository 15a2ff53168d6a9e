"""Frames of a dataset as an interchange folder: labels, maps, classes; reading it gives the same tables."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

from shapely.geometry import mapping

from scenicq.errors import Diagnostic
from scenicq.geometry.camera import Camera
from scenicq.geometry.features import MapFeature
from scenicq.store.dataset import Dataset
from scenicq.store.labels import Label, LabelObject

__all__ = ["label_record", "write_interchange", "write_map"]


def write_interchange(dataset: Dataset, frames: Collection[str], folder: Path) -> list[Diagnostic]:
    """Write the labels of some frames with the maps that they refer to.

    Args:
        dataset: Where they are from.
        frames: Their names.
        folder: An empty folder.

    Returns:
        Warnings about what the format cannot hold.
    """
    maps: set[str] = set()
    classes: dict[str, str] = {}
    egoless = False
    with (folder / "labels.jsonl").open("w", encoding="utf-8") as file:
        for label in dataset.labels(frames):
            egoless |= not label.has_ego
            members = (*([label.ego] if label.has_ego else []), *label.objects)
            classes.update((member.source_class, member.category) for member in members)
            maps.add(label.map)
            file.write(json.dumps(label_record(label, list(label.objects)), ensure_ascii=False) + "\n")
    classes.pop("", None)
    known = sorted(maps.intersection(dataset.manifest.maps))
    # The name of a map is that of its file, so it must be one: a name with a slash could lead out of the folder.
    named = [name for name in known if Path(name).name == name]
    for name in named:
        write_map(folder / "maps" / f"{name}.geojson", dataset.features(name))
    header = {"name": dataset.manifest.name, "interchange": 1, "angle": "heading", "classes": "classes.json"}
    if egoless:
        header["ego"] = "none"
    (folder / "dataset.json").write_text(json.dumps(header, indent=1) + "\n", encoding="utf-8")
    text = json.dumps(classes or {"car": "Car"}, indent=1, ensure_ascii=False, sort_keys=True)
    (folder / "classes.json").write_text(text + "\n", encoding="utf-8")
    return [
        Diagnostic("map-missing", f"map `{name}` is left out: no file can be called so", severity="warning")
        for name in sorted({*known} - {*named})
    ]


def label_record(label: Label, objects: list[LabelObject]) -> dict[str, Any]:
    """A label with some of its objects as one line's worth of plain values."""
    line: dict[str, Any] = {
        "id": label.frame,
        "recording": label.recording,
        "timestamp_us": label.timestamp_us,
        "map": label.map,
        "ego": _object(label.ego, named=False) if label.has_ego else None,
        "objects": [_object(member, named=True) for member in objects],
    }
    if label.params:
        line["params"] = dict(label.params)
    if label.sensors:
        line["sensors"] = {
            channel: _sensor(path, label.cameras.get(channel)) for channel, path in label.sensors.items()
        }
    return line


def _sensor(path: str, camera: Camera | None) -> str | dict[str, Any]:
    return path if camera is None else {"path": path, **camera._asdict()}


def _object(member: LabelObject, *, named: bool) -> dict[str, Any]:
    found: dict[str, Any] = {"id": member.id} if named else {}
    if member.source_class:
        found["class"] = member.source_class
    found |= {"position": [member.x, member.y], "heading": member.heading}
    for key in ("width", "length", "height", "velocity", "track"):
        if (value := getattr(member, key)) is not None:
            found[key] = value
    if (space := member.out_of_plane) is not None:
        known = {"z": space.z, "pitch": space.pitch, "roll": space.roll}
        found |= {key: value for key, value in known.items() if value is not None}
    if member.attributes:
        found["attributes"] = dict(member.attributes)
    return found


def write_map(file: Path, features: tuple[MapFeature, ...]) -> None:
    """Write map elements as GeoJSON, making the folder if need be."""
    file.parent.mkdir(exist_ok=True)
    collection = {"type": "FeatureCollection", "features": [_feature(feature) for feature in features]}
    file.write_text(json.dumps(collection, ensure_ascii=False) + "\n", encoding="utf-8")


def _feature(feature: MapFeature) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": {**feature.properties, "id": feature.id, "kind": feature.kind},
        "geometry": mapping(feature.shape),
    }
