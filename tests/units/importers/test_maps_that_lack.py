"""A map that a source gives, but without what a road network needs, is told at ingest."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from full_sources import FORMATS

from scenicq.importers.ingest import ingest


def write(format_: str, folder: Path, change: Callable[[list[dict[str, Any]]], object]) -> Path:
    """Write a source that has everything, after a change of the elements of its map."""
    document = FORMATS[format_].document()
    path = {"waymo": ("waymo", "map_features:8"), "interchange": ("geojson", "features")}[format_]
    change(document[path[0]][path[1]])
    folder.mkdir()
    FORMATS[format_].write(document, folder)
    return folder


def messages(folder: Path) -> list[str]:
    (folder.parent / "d").mkdir()
    return [each.message for each in ingest(folder, folder.parent / "d" / "x").diagnostics]


@pytest.mark.parametrize("format_", ["waymo", "interchange"])
def test_a_map_without_elements(format_, tmp_path):
    source = write(format_, tmp_path / "s", list.clear)
    (message,) = [each for each in messages(source) if "map" in each]
    assert message.endswith("has no elements; its labels are kept without a road network")


@pytest.mark.parametrize("format_", ["waymo", "interchange"])
def test_a_map_with_elements(format_, tmp_path):
    source = write(format_, tmp_path / "s", lambda features: None)
    assert not [each for each in messages(source) if "no elements" in each or "no intersection" in each]


def test_lanes_of_which_none_lies_in_an_intersection(tmp_path):
    """The flag is no longer written, so that a map says nothing of its intersections."""

    def clear_flag(features: list[dict[str, Any]]) -> None:
        for feature in features:
            feature.get("lane:3", {}).pop("interpolating:3", None)

    source = write("waymo", tmp_path / "s", clear_flag)
    assert len([each for each in messages(source) if "no lane is `interpolating`" in each]) == 1
