"""OpenDRIVE: the child process, its faults, the cache. Scenic itself is used where it is installed."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
import shapely
from full_sources import FORMATS, full

from scenicq.errors import DataError
from scenicq.geometry.features import read_geojson
from scenicq.geometry.network import Network
from scenicq.importers.ingest import ingest
from scenicq.importers.opendrive import convert_maps, convert_xodr
from scenicq.importers.opendrive_worker import Directions, explain
from scenicq.importers.report import Report
from scenicq.store.dataset import open_dataset

REAL = Path(__file__).parents[4] / "shared" / "data" / "opendrive"
SAMPLES = Path(__file__).parents[3] / "sample_data"
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
    assert [entry.what for entry in report.counts if entry.code == "map-lacks"] == ["map element"]


def lane(number: int, kind: str = "driving", attributes: str = "", more: str = "") -> str:
    width = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
    return f'<lane id="{number}" type="{kind}" level="false" {attributes}>{width}{more}</lane>'


def road(number: int, y: float, left: str, right: str, attributes: str = "") -> str:
    """A straight road of 100 m along x."""
    sides = f'<left>{left}</left><center><lane id="0" type="none"/></center><right>{right}</right>'
    return (
        f'<road name="" length="100" id="{number}" junction="-1" {attributes}><planView>'
        f'<geometry s="0" x="0" y="{y}" hdg="0" length="100"><line/></geometry></planView>'
        f'<lanes><laneSection s="0">{sides}</laneSection></lanes></road>'
    )


def opendrive(*elements: str) -> str:
    return f'<OpenDRIVE><header revMajor="1" revMinor="8"/>{"".join(elements)}</OpenDRIVE>'


def vector(way: str) -> str:
    return f'<userData><vectorLane travelDir="{way}"/></userData>'


DIRECTIONS = [
    # attributes of the road, number and attributes of the lane and what is in it, whether it runs along the road
    ("", -1, "", "", True),
    ("", 1, "", "", False),
    ('rule="RHT"', -1, "", "", True),
    ('rule="LHT"', -1, "", "", False),
    ('rule="LHT"', 1, "", "", True),
    ("", -1, 'direction="standard"', "", True),
    ("", -1, 'direction="reversed"', "", False),
    ("", 1, 'direction="reversed"', "", True),
    ('rule="LHT"', 1, 'direction="standard"', "", True),
    ('rule="LHT"', 1, 'direction="reversed"', "", False),
    ("", -1, "", vector("forward"), True),
    ("", 1, "", vector("backward"), False),
    ("", 1, "", vector("forward"), True),
    ("", -1, "", vector("backward"), False),
    ('rule="LHT"', -1, "", vector("forward"), False),
    ("", -1, "", vector("undirected"), True),
]


@pytest.mark.parametrize(("rule", "number", "attributes", "more", "along"), DIRECTIONS)
def test_each_lane_runs_as_its_road_and_itself_say(
    rule: str, number: int, attributes: str, more: str, along: bool
) -> None:
    sides = (lane(number, "driving", attributes, more), "")
    other = road(2, 50, lane(1), lane(-1))
    text = opendrive(road(1, 0, *(sides if number > 0 else sides[::-1]), rule), other)
    directions = Directions(ElementTree.fromstring(text))
    # Scenic takes lanes on the right to run along the road.
    assert ((number < 0) != directions.turned("1", number)) == along
    assert not directions.turned("2", 1)
    assert not directions.turned("2", -1)


@pytest.mark.skipif(importlib.util.find_spec("scenic") is None, reason="Scenic is not installed")
def test_roads_of_both_rules_in_one_map(tmp_path: Path) -> None:
    file = tmp_path / "mixed.xodr"
    roads: list[str] = []
    for number, (rule, lane_number, attributes, more, _) in enumerate(DIRECTIONS, start=1):
        sides = (lane(lane_number, "driving", attributes, more), "")
        roads.append(road(number, 50.0 * number, *(sides if lane_number > 0 else sides[::-1]), rule))
    file.write_text(opendrive(*roads))
    features = read_geojson(convert_xodr(file, tmp_path / "cache"), lambda _, problem: pytest.fail(problem))
    found: dict[int, bool] = {}
    for feature in features:
        if feature.kind == "lane":
            (line,) = feature.properties["centerline"]
            found[round(shapely.centroid(feature.shape).y / 50)] = line[-1][0] > line[0][0]
    assert found == {number: case[-1] for number, case in enumerate(DIRECTIONS, start=1)}


def test_lanes_that_are_lost_are_counted_by_type(xodr: Path, tmp_path: Path) -> None:
    right = lane(-1, "HOV") + lane(-2, "bus") + lane(-3, "bus", 'direction="both"') + lane(-4) + lane(-5, "biking")
    xodr.write_text(opendrive(road(1, 0, lane(1), right)))
    report = Report()
    convert_xodr(xodr, tmp_path, python=stand_in(tmp_path, f"printf '%s' '{EMPTY}' > \"$4\""))
    convert_maps({"Town": xodr}, tmp_path, report)
    counts = {entry.name: entry.count for entry in report.counts if entry.code == "not-read"}
    assert counts == {
        "lane/@type/HOV": 1, "lane/@type/bus": 2, "lane/@type/biking": 1, 'lane/@direction="both"': 1
    }  # fmt: skip
    told = [diagnostic.message for diagnostic in report.diagnostics if diagnostic.code == "map-lacks"]
    assert [("`HOV`" in text, "`bus`" in text) for text in told] == [(True, False), (False, True)]


class TestWhatScenicStumblesOver:
    """A stand-in for Scenic's parser, whose classes and variables are called the same."""

    def explain(self, tmp_path: Path, text: str, parse: Callable[[ElementTree.Element], object]) -> str:
        file = tmp_path / "map.xodr"
        file.write_text(text)
        try:
            parse(ElementTree.parse(file).getroot())
        except Exception as error:
            return explain(error, str(file))
        raise AssertionError("nothing was raised")

    def test_the_road_and_the_lane_are_named(self, tmp_path: Path) -> None:
        class Road:
            def __init__(self, id_: str) -> None:
                self.id_ = id_

        def parse_lanes(side: ElementTree.Element) -> None:
            for each in side.iter("lane"):
                float(each.get("nothing", "x"))

        def parse(root: ElementTree.Element) -> None:
            for element in root.iter("road"):
                made = Road(element.get("id", ""))
                parse_lanes(element)
                assert made

        text = self.explain(tmp_path, opendrive(road(7, 0, lane(1), lane(-1))), parse)
        assert text == "ValueError: could not convert string to float: 'x', at road `7`, lane `1`"

    @pytest.mark.parametrize("reads", [True, False])
    def test_what_is_not_there_is_named(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reads: bool) -> None:
        connection = '<connection id="0" incomingRoad="7" connectingRoad="9" contactPoint="start"/>'
        link = '<link><successor elementType="junction" elementId="3"/></link>'
        text = opendrive(
            road(7, 0, lane(1), lane(-1)).replace("<planView>", f"{link}<planView>"),
            f'<junction id="2">{connection}</junction>',
        )
        worker = tmp_path / "worker.py"
        fails = "sys.stderr.write('KeyError: 9')\nsys.exit(4)\n"
        worker.write_text("import sys\n" + (f"open(sys.argv[2], 'w').write('{EMPTY}')\n" if reads else fails))
        monkeypatch.setattr("scenicq.importers.opendrive._WORKER", worker)
        (tmp_path / "town.xodr").write_text(text)
        report = Report()
        try:
            convert_maps({"town": tmp_path / "town.xodr"}, tmp_path / "cache", report)
            said = "; ".join(each.message for each in report.diagnostics)
        except DataError as error:
            said = error.diagnostics[0].message
            assert "KeyError: 9; " in said
        assert "junction `2`: there is no connectingRoad `9`" in said
        assert "road `7`: its successor is junction `3`, which is not there" in said

    def test_no_temporary_path_is_named(self, tmp_path: Path) -> None:
        def parse(root: ElementTree.Element) -> None:
            raise ValueError(f"{tmp_path / 'map.xodr'} does not appear to be an OpenDRIVE file")

        said = self.explain(tmp_path, "<a/>", parse)
        assert said == "ValueError: the map does not appear to be an OpenDRIVE file"

    def test_xml(self, tmp_path: Path) -> None:
        assert "not sound XML" in self.explain(tmp_path, "<a", lambda root: None)


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("scenic") is None, reason="Scenic is not installed")
def test_the_recorded_map_is_what_the_parser_gives(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    whole = FORMATS["opendrive"]
    whole.write(full("opendrive"), tmp_path)
    content = (tmp_path / "town.xodr").read_bytes()
    features = json.loads(convert_xodr(tmp_path / "town.xodr", tmp_path / "cache").read_text())["features"]
    if request.config.getoption("--update-golden"):
        lines = ",\n".join(json.dumps(each) for each in features)
        told = f'{{"map": "{hashlib.sha256(content).hexdigest()}", "features": [\n{lines}\n]}}\n'
        whole.recorded.write_text(told, encoding="utf-8")
    assert json.loads(whole.recorded.read_text(encoding="utf-8"))["features"] == features


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
