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
    ring = [[-9, -9], [9, -9], [9, 9], [-9, -9]]
    shape = {"type": "Polygon", "coordinates": [ring]}
    features = [{"type": "Feature", "geometry": shape, "properties": {"id": "1", "kind": "drivable"}}]
    content: dict[str, Any] = {"type": "FeatureCollection", "features": features}
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


def told(folder: Path, rows: list[dict[str, Any]], target: Path) -> dict[str, int]:
    """What an ingest assumes of some labels, each with its count."""
    (folder / "labels.jsonl").write_text("\n".join(map(json.dumps, rows)))
    summary = ingest(folder, target, strict=True)
    return {entry.name: entry.count for entry in summary.left_out if entry.code == "assumed"}


def label(number: int, time: float, heading: float = 0.5, kind: str = "Car") -> dict[str, Any]:
    entry = {"position": [number, 0], "heading": heading}
    return {"id": f"f{number}", "recording": "r", "timestamp_us": round(time * 1e6), "map": "m", "ego": entry,
            "objects": [entry | {"id": "a", "track": "a", "class": kind}]}  # fmt: skip


@pytest.mark.parametrize(
    ("headings", "count"),
    [
        ((-3.2, 3.1, 6.3, 12.0), 0),  # radians, of turns counted on
        ((0.5, 90.0, 180.0, 270.0), 6),
        ((-179.0, -0.5, 90.0, 0.1), 4),
    ],
)
def test_headings_in_degrees(headings: tuple[float, ...], count: int, tmp_path: Path) -> None:
    rows = [label(n, n / 10, heading) for n, heading in enumerate(headings)]
    found = told(write(tmp_path / "s", 1), rows, tmp_path / "d")
    assert found == ({"angles in radians": count} if count else {})


@pytest.mark.parametrize(
    ("times", "back"),
    [
        (range(12), False),
        ([0, 1, 2, 3, 4, 5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5], True),
        ([3, 9, 1, 7, 2, 8, 0, 6, 4, 10, 5, 11], False),  # in no order
        ([0, 1, 2, 3, 1.5, 2.5], False),  # may be in no order
    ],
)
def test_a_clock_that_is_set_back(times: list[float], back: bool, tmp_path: Path) -> None:
    found = told(write(tmp_path / "s", 1), [label(n, time) for n, time in enumerate(times)], tmp_path / "d")
    assert found == ({"order of times in r": 1} if back else {})


def test_a_track_that_changes_its_class(tmp_path: Path) -> None:
    rows = [label(n, n, kind=kind) for n, kind in enumerate(["Car", "Car", "Truck", "Car"])]
    source = write(tmp_path / "s", 1)
    assert told(source, rows, tmp_path / "d") == {"tracks that change their class": 1}
    (warning,) = ingest(source, tmp_path / "e").diagnostics
    assert warning.message == "track `a` of recording `r` is `Car` in 3 frames and `Truck` in 1 frames"


@pytest.mark.parametrize(
    ("step_m", "step_us", "jumps"),
    [
        (3.0, 100_000, False),  # 108 km/h at 10 Hz
        (4.0, 10_000, False),  # a label that is off by metres
        (40.0, 500_000, False),  # 288 km/h
        (80.0, 500_000, True),
        (11.0, 100_000, True),
    ],
)
def test_tracks_that_jump(step_m: float, step_us: int, jumps: bool, tmp_path: Path) -> None:
    """Of two cars and a thing without a track, one car is somewhere else from the third label on."""
    folder = write(tmp_path / "s", step_us)
    rows = [json.loads(line) for line in (folder / "labels.jsonl").read_text().splitlines()]
    size = {"width": 2.0, "length": 4.0, "heading": 0.0, "class": "Car"}
    for number, row in enumerate(rows):
        moved = step_m if number >= 2 else 0.0
        row["objects"] = [
            {"id": f"a{number}", "track": "a", "position": [0.0, 9.0 + moved], **size},
            {"id": f"b{number}", "track": "b", "position": [number * 1e-3, 30.0], **size},
            {"id": f"c{number}", "position": [500.0 * number, 60.0], **size},
        ]
    found = told(folder, rows, tmp_path / "d")
    assert found.get("tracks that jump", 0) == int(jumps)
