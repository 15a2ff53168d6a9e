"""OpenDRIVE: the child process, its faults, the cache. Scenic itself is used where it is installed."""

from __future__ import annotations

import importlib.util
import json
import shutil
import sys
from pathlib import Path

import pytest

from scenicq.errors import DataError
from scenicq.geometry.features import read_geojson
from scenicq.geometry.network import Network
from scenicq.importers.ingest import ingest
from scenicq.importers.opendrive import convert_maps, convert_xodr
from scenicq.importers.report import Report
from scenicq.store.dataset import open_dataset

REAL = Path(__file__).parents[3] / "shared" / "data" / "opendrive"
SAMPLES = Path(__file__).parents[2] / "sample_data"
EMPTY = json.dumps({"type": "FeatureCollection", "features": []})

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="stands in for Python with a shell script")


@pytest.fixture
def xodr(tmp_path: Path) -> Path:
    file = tmp_path / "maps" / "Town.xodr"
    file.parent.mkdir()
    file.write_text('<OpenDRIVE><objects><object type="crosswalk"/></objects></OpenDRIVE>')
    return file


def stand_in(tmp_path: Path, script: str) -> str:
    """A Python that runs a line of shell instead: $3 is the copy of the map, $4 the file to write."""
    file = tmp_path / "python"
    file.write_text(f"#!/bin/sh\n{script}\n")
    file.chmod(0o755)
    return str(file)


def code(xodr: Path, tmp_path: Path, script: str, timeout_s: float = 20) -> tuple[str, str]:
    with pytest.raises(DataError) as error:
        convert_xodr(xodr, tmp_path / "cache", python=stand_in(tmp_path, script), timeout_s=timeout_s)
    (diagnostic,) = error.value.diagnostics
    assert list((tmp_path / "cache").iterdir()) == []
    return diagnostic.code, diagnostic.message


def test_what_the_parser_gives_is_kept_by_content(xodr: Path, tmp_path: Path) -> None:
    python = stand_in(tmp_path, f"echo x >> {tmp_path}/calls; printf '%s' '{EMPTY}' > \"$4\"; touch map.snet")
    made = convert_xodr(xodr, tmp_path / "cache", python=python)
    assert made.read_text() == EMPTY
    elsewhere = Path(shutil.copy(xodr, tmp_path / "other.xodr"))
    assert convert_xodr(elsewhere, tmp_path / "cache", python=python) == made
    assert (tmp_path / "calls").read_text() == "x\n"
    xodr.write_text("<OpenDRIVE/>")
    assert convert_xodr(xodr, tmp_path / "cache", python=python) != made
    assert sorted(path.name for path in xodr.parent.iterdir()) == ["Town.xodr"]
    assert {path.suffix for path in (tmp_path / "cache").iterdir()} == {".geojson", ".sha256"}


def test_faults_of_the_child(xodr: Path, tmp_path: Path) -> None:
    assert code(xodr, tmp_path, "exit 3")[0] == "option-invalid"
    kind, message = code(xodr, tmp_path, "echo Traceback >&2; echo 'AssertionError: containsRegion' >&2; exit 4")
    assert kind == "file-invalid"
    assert "AssertionError: containsRegion" in message
    assert "Traceback" not in message
    assert code(xodr, tmp_path, "kill -9 $$")[0] == "file-invalid"
    assert "gave nothing" in code(xodr, tmp_path, "exit 0")[1]
    assert "longer than" in code(xodr, tmp_path, "exec sleep 5", 0.2)[1]


def test_what_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(DataError) as error:
        convert_xodr(tmp_path / "none.xodr", tmp_path / "cache")
    assert error.value.diagnostics[0].code == "file-missing"


def test_crossings_that_are_lost_are_told(xodr: Path, tmp_path: Path) -> None:
    report = Report()
    convert_xodr(xodr, tmp_path, python=stand_in(tmp_path, f"printf '%s' '{EMPTY}' > \"$4\""))
    files = convert_maps({"Town": xodr, "other": tmp_path / "x.geojson"}, tmp_path, report)
    assert files["other"] == tmp_path / "x.geojson"
    assert files["Town"].suffix == ".geojson"
    assert [(entry.what, entry.code) for entry in report.counts] == [("map element", "map-lacks")]


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("scenic") is None, reason="Scenic is not installed")
@pytest.mark.skipif(not REAL.exists(), reason="the maps are not on this machine")
@pytest.mark.parametrize(("name", "counts"), [("Town01", (26, 124, 12, 12)), ("Town05", (53, 486, 21, 18))])
def test_real_maps(tmp_path: Path, name: str, counts: tuple[int, int, int, int]) -> None:
    made = convert_xodr(REAL / f"{name}.xodr", tmp_path)
    problems: list[str] = []
    network = Network(name, read_geojson(made, lambda identifier, problem: problems.append(problem)))
    assert not problems
    signals = sum(crossing.properties["signalized"] for crossing in network.intersections)
    assert (len(network.roads), len(network.lanes), len(network.intersections), signals) == counts
    assert all(lane.successors for lane in network.lanes if lane.maneuvers)


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("scenic") is None, reason="Scenic is not installed")
@pytest.mark.skipif(not REAL.exists(), reason="the maps are not on this machine")
def test_ingest_with_a_map_of_opendrive(tmp_path: Path) -> None:
    ingest(SAMPLES / "crossroads", tmp_path / "d", maps=[f"crossroads={REAL / 'Town01.xodr'}"])
    assert len(open_dataset(tmp_path / "d").network("crossroads").lanes) == 124


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("scenic") is None, reason="Scenic is not installed")
@pytest.mark.skipif(not REAL.exists(), reason="the maps are not on this machine")
def test_left_hand_traffic_mirrors_what_scenic_reads(tmp_path: Path) -> None:
    """Scenic 3.1.1 does not read the rule of a road, so all traffic keeps to the right in what it gives."""
    text = (REAL / "Town01.xodr").read_text()
    (tmp_path / "left.xodr").write_text(text.replace("<road ", '<road rule="LHT" '))
    problems: list[str] = []
    right, left = (
        Network("town", read_geojson(convert_xodr(file, tmp_path), lambda _, problem: problems.append(problem)))
        for file in (REAL / "Town01.xodr", tmp_path / "left.xodr")
    )
    assert not problems
    for one, other in zip(right.lanes, left.lanes, strict=True):
        assert one.centerline is not None
        assert other.centerline is not None
        (line,), (back,) = one.centerline.lines, other.centerline.lines
        assert line.reverse().equals_exact(back, 1e-9)
        assert {lane.id for lane in one.successors} == {lane.id for lane in other.predecessors}
    for one, other in zip(right.laneSections, left.laneSections, strict=True):
        sides = (one._laneToLeft, one._laneToRight), (other._laneToRight, other._laneToLeft)
        assert [side and side.id for side in sides[0]] == [side and side.id for side in sides[1]]
    assert sum(len(lane.maneuvers) for lane in left.lanes) == sum(len(lane.maneuvers) for lane in right.lanes) > 100
