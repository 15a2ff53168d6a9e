"""Elements of kinds that Scenic does not know: a program can name them, or they are counted as left out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import scenicq
from scenicq.geometry.features import KNOWN_KINDS, region_name
from scenicq.importers.ingest import ingest

KINDS = {
    "parking": "parkingRegion",
    "carpark_area": "carparkAreaRegion",
    "speed-bump": "speedBumpRegion",
    "bus stop": "busStopRegion",
    "Straße": "StraßeRegion",
    "a(b)": None,
    "1st": None,
    "_": None,
    "walkable": None,
}


def folder(path: Path, kinds: list[str]) -> Path:
    """A car on the square of each kind, one frame each."""

    def square(number: int) -> list[list[float]]:
        x = 100.0 * number
        return [[x, 0.0], [x + 9, 0.0], [x + 9, 9.0], [x, 9.0], [x, 0.0]]

    features = [
        {"geometry": {"type": "Polygon", "coordinates": [square(n)]}, "properties": {"id": str(n), "kind": kind}}
        for n, kind in enumerate(kinds)
    ]
    labels: list[dict[str, Any]] = [
        {
            "id": f"f{n}", "recording": "r", "timestamp_us": n * 100_000, "map": "town", "objects": [],
            "ego": {"position": [100.0 * n + 4, 4.0], "heading": 0.0},
        }
        for n in range(len(kinds))
    ]  # fmt: skip
    (path / "maps").mkdir(parents=True)
    (path / "dataset.json").write_text('{"interchange": 1, "angle": "heading", "classes": "scenic"}')
    (path / "labels.jsonl").write_text("".join(json.dumps(label) + "\n" for label in labels))
    (path / "maps" / "town.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def test_each_kind_is_named_or_counted(tmp_path: Path) -> None:
    summary = ingest(folder(tmp_path / "s", list(KINDS)), tmp_path / "d")
    counts = {entry.name: entry.count for entry in summary.left_out if entry.code == "not-read"}
    unnamed = [kind for kind, name in KINDS.items() if name is None]
    assert counts == {f"map elements of the kind `{kind}`, which no program can name": 1 for kind in unnamed}
    dataset = scenicq.open(tmp_path / "d")
    for number, (kind, name) in enumerate(KINDS.items()):
        assert region_name(kind) == name
        if name is not None:
            program = f"ego = new Car in network.{name}, facing Range(0, 360) deg\n"
            assert [match.frame for match in dataset.match(program)] == [f"f{number}"], kind


@pytest.mark.parametrize("name", ["carpark_area", "carparkAreaRegion"])
def test_whoever_writes_the_kind_is_told_what_it_is_called(tmp_path: Path, name: str) -> None:
    ingest(folder(tmp_path / "s", ["carpark_area", "parking"]), tmp_path / "d")
    with pytest.raises(scenicq.ScenicqError, match=f"`{name}` is not defined") as error:
        list(scenicq.open(tmp_path / "d").match(f"ego = new Car in {name}\n"))
    (hint,) = error.value.diagnostics[0].hints
    assert hint == "`network.carparkAreaRegion` is what the map has of this kind"


def test_what_scenic_knows_has_its_own_name() -> None:
    assert {region_name(kind) for kind in KNOWN_KINDS} == {None}


def test_a_map_without_the_kind_is_told(tmp_path: Path) -> None:
    ingest(folder(tmp_path / "s", ["parking"]), tmp_path / "d")
    with pytest.raises(scenicq.ScenicqError, match="no elements of the kind `parkin`") as error:
        list(scenicq.open(tmp_path / "d").match("ego = new Car on network.parkinRegion\n"))
    assert "it has `network.parkingRegion`" in str(error.value.diagnostics[0].hints)
