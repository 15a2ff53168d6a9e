"""A map that a source gives, but without what a road network needs, is told at ingest."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from full_sources import FORMATS

from scenicq.importers.ingest import ingest


def waymo(folder: Path, change: Callable[[list[dict[str, Any]]], None]) -> None:
    document = FORMATS["waymo"].document()
    change(document["waymo"]["map_features:8"])
    FORMATS["waymo"].write(document, folder)


def interchange(folder: Path, change: Callable[[list[dict[str, Any]]], None]) -> None:
    square = [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 0.0]]
    shape = {"type": "Polygon", "coordinates": [square]}
    features = [{"type": "Feature", "geometry": shape, "properties": {"id": "1", "kind": "lane"}}]
    change(features)
    label = {"id": "f", "recording": "r", "timestamp_us": 1, "map": "town", "objects": []}
    (folder / "maps").mkdir()
    (folder / "dataset.json").write_text('{"interchange": 1, "angle": "heading", "classes": "scenic"}')
    (folder / "labels.jsonl").write_text(json.dumps(label | {"ego": {"position": [4.0, 4.0], "heading": 0.0}}))
    (folder / "maps" / "town.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))


def messages(folder: Path) -> list[str]:
    (folder.parent / "d").mkdir()
    return [each.message for each in ingest(folder, folder.parent / "d" / "x").diagnostics]


@pytest.mark.parametrize("write", [waymo, interchange])
def test_a_map_without_elements(write, tmp_path):
    (tmp_path / "s").mkdir()
    write(tmp_path / "s", list.clear)
    (message,) = [each for each in messages(tmp_path / "s") if "map" in each]
    assert message.endswith("has no elements; its labels are kept without a road network")


@pytest.mark.parametrize("write", [waymo, interchange])
def test_a_map_with_elements(write, tmp_path):
    (tmp_path / "s").mkdir()
    write(tmp_path / "s", lambda features: None)
    assert not [each for each in messages(tmp_path / "s") if "no elements" in each or "no intersection" in each]


def test_lanes_of_which_none_lies_in_an_intersection(tmp_path):
    """The flag is no longer written, so that a map says nothing of its intersections."""

    def clear_flag(features: list[dict[str, Any]]) -> None:
        for feature in features:
            feature.get("lane:3", {}).pop("interpolating:3", None)

    (tmp_path / "s").mkdir()
    waymo(tmp_path / "s", clear_flag)
    assert len([each for each in messages(tmp_path / "s") if "no lane is `interpolating`" in each]) == 1
