"""Times and maps in other units than ours are told."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest


def write(folder: Path, step_us: int, crs: str | None = None) -> Path:
    (folder / "maps").mkdir(parents=True)
    header = {"name": "m", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (folder / "dataset.json").write_text(json.dumps(header))
    rows = [
        {"id": f"f{n}", "recording": "r", "timestamp_us": n * step_us, "map": "m", "objects": [],
         "ego": {"position": [n, 0], "heading": 0.0}}
        for n in range(5)
    ]  # fmt: skip
    (folder / "labels.jsonl").write_text("\n".join(map(json.dumps, rows)))
    content: dict[str, Any] = {"type": "FeatureCollection", "features": []}
    if crs is not None:
        content["crs"] = {"type": "name", "properties": {"name": crs}}
    (folder / "maps" / "m.geojson").write_text(json.dumps(content))
    return folder


@pytest.mark.parametrize(
    ("step_us", "told"),
    [
        (100_000, False),  # microseconds of 10 Hz
        (500_000, False),
        (2_000, False),
        (60_000_000, False),
        (100, True),  # milliseconds taken for microseconds
        (1, True),  # seconds
        (500_000_000, True),  # nanoseconds of 2 Hz
    ],
)
def test_rates_that_no_recorder_has(step_us: int, told: bool, tmp_path: Path) -> None:
    summary = ingest(write(tmp_path / "s", step_us), tmp_path / "d", strict=True)
    assert any(entry.name == "times in microseconds" for entry in summary.left_out) == told
    assert any("may not be microseconds" in each.message for each in summary.diagnostics) == told


@pytest.mark.parametrize(
    ("crs", "refused"),
    [
        (None, False),
        ("urn:ogc:def:crs:EPSG::32719", False),
        ("urn:ogc:def:crs:OGC:1.3:CRS84", True),
        ("EPSG:4326", True),
        ("urn:ogc:def:crs:EPSG::4326", True),
    ],
)
def test_maps_in_degrees(crs: str | None, refused: bool, tmp_path: Path) -> None:
    source = write(tmp_path / "s", 100_000, crs)
    if not refused:
        ingest(source, tmp_path / "d")
        return
    with pytest.raises(DataError) as error:
        ingest(source, tmp_path / "d")
    (diagnostic,) = error.value.diagnostics
    assert "degrees" in diagnostic.message
    assert "ogr2ogr" in diagnostic.hints[0]
