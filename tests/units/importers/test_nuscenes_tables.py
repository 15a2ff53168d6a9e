"""Rows that are decoded at once are what they are alone, with the same said of what is unsound; times and egos."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenicq.errors import DataError
from scenicq.importers import json_tables
from scenicq.importers.ingest import ingest
from scenicq.importers.nuscenes_tables import Tables
from scenicq.importers.report import Report
from scenicq.store.dataset import open_dataset

TINY = Path(__file__).parents[3] / "sample_data" / "nuscenes_tiny" / "v1.0-tiny"
TABLES = ("sample_annotation", "sample_data", "ego_pose")
JUNK = [None, True, 0, -1, 2.5, float("nan"), 10**400, "", "x", "\ud800", [], [1, 0, 0], [1, 0, 0, None], {}]
PIECES = [
    '"',
    "\\",
    "{",
    "}",
    "[",
    "]",
    ",",
    ":",
    "-",
    "0",
    ".",
    "\n",
    "\x01",
    "null",
    "NaN",
    "1e999",
    "\\u0061",
    "{}, ",
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(TINY, tmp_path / "v1.0-tiny"))


def read(folder: Path) -> list[Any]:
    """All that is read of the tables and said of them."""
    report = Report()
    try:
        tables = Tables(folder, report)
    except DataError as error:
        return [error.diagnostics]
    content = [tables.scene(token) for token in tables.scenes]
    return [
        tables.poses,
        tables.sensors,
        [scene.digest() for scene in content],
        report.tally,
        sorted(each.message for each in report.problems),
    ]


def without_blocks() -> Any:
    """Each element is found alone, as where nothing else is known of the text."""
    return patch.object(json_tables, "_TAIL", 0)


@pytest.mark.parametrize("table", TABLES)
@settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_rows_at_once_are_what_they_are_alone(folder: Path, table: str, data: st.DataObject) -> None:
    rows = json.loads((TINY / f"{table}.json").read_bytes())
    for _ in range(data.draw(st.integers(0, 2))):
        row = data.draw(st.sampled_from(rows))
        key = data.draw(st.sampled_from(sorted(row)))
        if data.draw(st.booleans()):
            row[key] = data.draw(st.sampled_from(JUNK))
        else:
            del row[key]
    text = json.dumps(rows, indent=data.draw(st.sampled_from([None, 0, 2])))
    if data.draw(st.booleans()):
        at = data.draw(st.integers(0, len(text)))
        text = text[:at] + data.draw(st.sampled_from(PIECES)) + text[at + data.draw(st.integers(0, 2)) :]
    (folder / f"{table}.json").write_text(text, encoding="utf-8")
    found = read(folder)
    with without_blocks():
        assert read(folder) == found


def test_a_field_of_no_list_is_counted_and_what_is_beside_it_read(folder: Path) -> None:
    before = read(folder)
    for table in TABLES:
        rows = json.loads((folder / f"{table}.json").read_bytes())
        for row in rows:
            row["more"] = [1e300]
        (folder / f"{table}.json").write_text(json.dumps(rows))
    after = read(folder)
    assert after[:2] == before[:2]
    counts = {name: count for _, code, name, _, count in after[3] if code == "not-read" and name.endswith("/more")}
    assert set(counts) == {f"{table}/more" for table in TABLES}


@pytest.mark.parametrize(("share", "told"), [(0.0, False), (0.8, True)])
def test_times_as_floats(share: float, told: bool, tmp_path: Path) -> None:
    source = tmp_path / "source"
    shutil.copytree(TINY.parent, source)
    (file,) = source.glob("*/sample.json")
    rows = json.loads(file.read_text())
    whole = [row["timestamp"] for row in rows]
    for row in rows:
        row["timestamp"] += share
    file.write_text(json.dumps([{**row, "timestamp": float(row["timestamp"])} for row in rows]))
    summary = ingest(source, tmp_path / "d")
    found = sorted(label.timestamp_us for label in open_dataset(tmp_path / "d").labels())
    assert found == sorted(time + round(share) for time in whole)
    assert any(entry.name == "rounded times" for entry in summary.left_out) == told


@pytest.mark.parametrize("as_records", [False, True])
def test_without_a_lidar_the_ego_is_where_it_was_at_the_nearest_key_frame(as_records: bool, tmp_path: Path) -> None:
    source = Path(shutil.copytree(TINY.parent, tmp_path / "source"))
    ingest(source, tmp_path / "before")
    (folder,) = source.glob("v1.0-*")
    sensors = json.loads((folder / "sensor.json").read_text())
    changed = [{**row, "channel": row["channel"].replace("LIDAR_TOP", "RADAR_FRONT")} for row in sensors]
    (folder / "sensor.json").write_text(json.dumps(changed))
    # another radar, a moment later and further on, comes first
    (mount,) = (row for row in sensors if row["channel"] == "LIDAR_TOP")
    calibrated = json.loads((folder / "calibrated_sensor.json").read_text())
    of_radar = {row["token"] for row in calibrated if row["sensor_token"] == mount["token"]}
    files = json.loads((folder / "sample_data.json").read_text())
    poses = json.loads((folder / "ego_pose.json").read_text())
    later: list[dict[str, Any]] = []
    for row in files:
        if row["calibrated_sensor_token"] in of_radar:
            anew = {key: f"later{row[key]}" for key in ("token", "ego_pose_token")}
            later.append({**row, **anew, "timestamp": 30_000 + row["timestamp"]})
    wanted = {row["ego_pose_token"] for row in later}
    moved = [{**row, "token": f"later{row['token']}"} for row in poses if f"later{row['token']}" in wanted]
    moved = [{**row, "translation": [row["translation"][0] + 9.0, *row["translation"][1:]]} for row in moved]
    extra = {"unknown": 1} if as_records else {}
    (folder / "sample_data.json").write_text(json.dumps([{**row, **extra} for row in [*later, *files]]))
    (folder / "ego_pose.json").write_text(json.dumps([*moved, *poses]))
    summary = ingest(source, tmp_path / "after")
    before, after = (list(open_dataset(tmp_path / name).labels()) for name in ("before", "after"))
    assert before
    assert [(each.timestamp_us, each.ego) for each in before] == [(each.timestamp_us, each.ego) for each in after]
    assert [entry.name for entry in summary.left_out].count("ego pose") == 1
