"""Argoverse 2: what its map becomes, sensor files, unsound logs, agreement with the map."""

from __future__ import annotations

import json
import math
import shutil
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.feather
import pytest
from label_rows import labels_of

from scenicq.errors import DataError
from scenicq.geometry import angles
from scenicq.geometry.network import Network
from scenicq.importers.argoverse2 import Argoverse2
from scenicq.importers.base import ImportOptions
from scenicq.importers.ingest import ingest
from scenicq.importers.report import Report
from scenicq.store.classes import is_subclass
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label

SAMPLE = Path(__file__).parents[3] / "sample_data" / "argoverse2_tiny"
REAL = Path(__file__).parents[4] / "shared" / "data" / "argoverse2"
LOG = "5ce0c0de-0000-4000-8000-000000000001"


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """A copy of the tiny log that a test may spoil."""
    return Path(shutil.copytree(SAMPLE, tmp_path / "source"))


def recordings(path: Path) -> list[list[Label]]:
    report = Report()
    return [labels_of(each) for each in Argoverse2().read(path, ImportOptions(), report).recordings(report)]


def change(source: Path, name: str, edit: Callable[[list[dict[str, Any]]], object]) -> None:
    file = source / "val" / LOG / f"{name}.feather"
    rows = pyarrow.feather.read_table(file).to_pylist()
    edit(rows)
    pyarrow.feather.write_feather(pa.Table.from_pylist(rows), str(file))


def test_logs_without_boxes_are_counted(source: Path) -> None:
    """As those for testing are, which lie where the others do once all of the dataset is there."""
    bare = Path(shutil.copytree(source / "val" / LOG, source / "val" / "bare"))
    (bare / "annotations.feather").unlink()
    report = Report()
    Argoverse2().read(source, ImportOptions(), report)
    assert [(entry.name, entry.count) for entry in report.counts if "log" in entry.name] == [
        ("log without annotations.feather", 1)
    ]


def test_lanes_know_their_groups_roads_and_intersection() -> None:
    source = Argoverse2().read(SAMPLE, ImportOptions(), Report())
    network = Network(LOG, source.maps[LOG])
    assert not network.problems
    lanes = {lane.id: lane for lane in network.lanes}
    assert [lanes[name].id for name in ("1", "2", "3", "4")] == ["1", "2", "3", "4"]
    assert len(network.roads) == len(network.connectingRoads) == 1
    east, west = lanes["1"], lanes["2"]
    assert east.road is west.road is network.roads[0]
    assert east.group is not None
    assert east.group.opposite is west.group
    assert [lane.id for lane in east.successors] == ["3"]
    (crossing,) = network.intersections
    assert {lane.id for lane in crossing.lanes} == {"3", "4"}
    assert crossing.polygon.area == pytest.approx(20 * 7)
    assert network.roadDirection.values(30, -1) == pytest.approx((-math.pi / 2,))
    assert network.roadDirection.values(30, 1) == pytest.approx((math.pi / 2,))
    assert network.crossings[0].polygon.area == pytest.approx(4 * 7)
    assert network.region("drivable") is not None


def test_dangling_lanes_are_counted_and_kept_out(tmp_path: Path) -> None:
    summary = ingest(SAMPLE, tmp_path / "d")
    assert [(entry.what, entry.count, entry.kept) for entry in summary.left_out] == [("map element", 2, True)]


def test_sensor_files(source: Path) -> None:
    folder = source / "val" / LOG / "sensors" / "cameras" / "ring_front_center"
    folder.mkdir(parents=True)
    for time in (1699999999990000000, 1700000000040000000, 1700000000111000000):
        (folder / f"{time}.jpg").touch()
    (folder / "notes.jpg").touch()
    (recording,) = recordings(source)
    start = f"val/{LOG}/sensors"
    assert [label.sensors["ring_front_center"][-23:-4] for label in recording[:3]] == [
        "1699999999990000000",
        "1700000000111000000",
        "1700000000111000000",
    ]
    assert recording[1].sensors["lidar"] == f"{start}/lidar/1700000000100000000.feather"
    (alone,) = recordings(source / "val" / LOG)
    assert alone[1].sensors["lidar"] == "sensors/lidar/1700000000100000000.feather"


def test_without_a_map(source: Path, tmp_path: Path) -> None:
    shutil.rmtree(source / "val" / LOG / "map")
    summary = ingest(source, tmp_path / "d")
    assert [(entry.code, entry.count) for entry in summary.left_out] == [("map-missing", 6)]
    assert summary.frames == 6


@pytest.mark.parametrize(
    ("edit", "told"),
    [
        (lambda rows: rows[0].update(qw=0.0, qx=0.0, qy=0.0, qz=0.0), "not a unit quaternion"),
        (lambda rows: rows[0].update(tx_m=math.nan), "pose is not finite"),
        (lambda rows: rows[0].update(length_m=-1.0), "size is not positive"),
        (lambda rows: rows[0].update(track_uuid=None), "is missing"),
        (lambda rows: rows[0].update(track_uuid=rows[1]["track_uuid"]), "is used twice"),
    ],
)
def test_an_unsound_box_is_left_out(
    source: Path, tmp_path: Path, edit: Callable[[list[dict[str, Any]]], object], told: str
) -> None:
    change(source, "annotations", edit)
    summary = ingest(source, tmp_path / "d")
    assert summary.objects == 11
    assert any(told in diagnostic.message for diagnostic in summary.diagnostics)


def test_frames_without_a_pose_are_left_out(source: Path, tmp_path: Path) -> None:
    change(source, "city_SE3_egovehicle", lambda rows: rows.pop(2))
    summary = ingest(source, tmp_path / "d")
    assert (summary.frames, summary.objects) == (5, 10)


@pytest.mark.parametrize("name", ["annotations.feather", "city_SE3_egovehicle.feather"])
@pytest.mark.parametrize("junk", [b"", b"ARROW1", b"\0" * 999, b"cut", b"schema", b"huge"])
def test_a_log_that_cannot_be_read_is_one_diagnostic(source: Path, tmp_path: Path, name: str, junk: bytes) -> None:
    file = source / "val" / LOG / name
    if junk == b"cut":
        junk = file.read_bytes()[:-300]
    elif junk == b"schema":
        pyarrow.feather.write_feather(pa.table({"x": [1]}), str(file))
        junk = file.read_bytes()
    elif junk == b"huge":
        # The length of a column's buffer in the metadata, claimed to be 10 GB.
        rows = 12 if name.startswith("annotations") else 6
        junk = file.read_bytes().replace((rows * 8).to_bytes(8, "little"), (10**10).to_bytes(8, "little"))
        assert junk != file.read_bytes()
    file.write_bytes(junk)
    with pytest.raises(DataError) as error:
        ingest(source, tmp_path / "d")
    codes = [diagnostic.code for diagnostic in error.value.diagnostics]
    assert codes[0] == "dataset-empty"
    assert codes.count("file-invalid") == 1


def test_a_bad_log_does_not_hinder_a_good_one(source: Path, tmp_path: Path) -> None:
    shutil.copytree(source / "val" / LOG, source / "val" / "another")
    (source / "val" / LOG / "annotations.feather").write_bytes(b"nothing")
    (source / "val" / "another" / "map" / f"log_map_archive_{LOG}____TNY_city_1.json").write_text('{"lane_segments": [')
    summary = ingest(source, tmp_path / "d")
    assert (summary.recordings, summary.frames) == (1, 6)
    assert {(entry.what, entry.code) for entry in summary.left_out} >= {
        ("recording", "file-invalid"),
        ("map", "file-invalid"),
        ("label", "map-missing"),
    }


@pytest.mark.parametrize(
    "edit",
    [
        lambda lane: lane.update(left_lane_boundary=[]),
        lambda lane: lane.update(left_lane_boundary=[{"x": 1, "y": math.nan}] * 2),
        lambda lane: lane.update(left_lane_boundary=lane["right_lane_boundary"]),
        lambda lane: lane.update(left_lane_boundary="x"),
        lambda lane: lane.update(right_lane_boundary=[{"x": 1e300, "y": 0}, {"x": 0, "y": 0}]),
    ],
)
def test_an_unsound_lane_is_left_out(source: Path, tmp_path: Path, edit: Callable[[dict[str, Any]], object]) -> None:
    file = next((source / "val" / LOG / "map").glob("*.json"))
    content = json.loads(file.read_text())
    edit(content["lane_segments"]["1"])
    file.write_text(json.dumps(content))
    ingest(source, tmp_path / "d")
    dataset = open_dataset(tmp_path / "d")
    assert [lane.id for lane in dataset.network(LOG).lanes] == ["2", "3", "4"]
    assert any(entry.what == "map element" and not entry.kept for entry in dataset.manifest.left_out)


@pytest.mark.skipif(not REAL.exists(), reason="the logs are not on this machine")
@pytest.mark.slow
def test_real_vehicles_head_where_they_move_and_along_their_lane(tmp_path: Path) -> None:
    ingest(REAL, tmp_path / "d")
    dataset = open_dataset(tmp_path / "d")
    inside: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for frame, member, kind in (
        dataset.connect()
        .sql("SELECT frame, object, kind FROM memberships WHERE distance = 0 AND kind IN ('lane', 'intersection')")
        .fetchall()
    ):
        inside[frame, member].append(kind)
    networks = {name: dataset.network(name) for name in dataset.maps}
    motion: list[float] = []
    along: list[float] = []
    for label in dataset.labels():
        for member in (label.ego, *label.objects):
            if not is_subclass(member.category, "Vehicle") or member.velocity is None or member.heading is None:
                continue
            speed = math.hypot(*member.velocity)
            if speed > 3:
                motion.append(angles.distance(member.heading, angles.heading_of(*member.velocity)))
            if speed > 2 and inside[label.frame, member.id] == ["lane"]:
                direction = networks[label.map].roadDirection.values(member.x, member.y)[0]
                along.append(angles.distance(member.heading, direction))
    assert len(motion) > 3000
    assert len(along) > 2000
    assert sum(angle < math.radians(15) for angle in motion) >= 0.99 * len(motion)
    assert sum(angle < math.radians(15) for angle in along) >= 0.95 * len(along)


@pytest.mark.parametrize("kind", ["large_string", "string_view", "dictionary"])
def test_every_kind_of_text_of_arrow(kind: str, tmp_path: Path) -> None:
    source = tmp_path / "source"
    shutil.copytree(SAMPLE, source)
    for file in source.rglob("annotations.feather"):
        table = pa.feather.read_table(file)
        types = {"large_string": pa.large_string(), "string_view": pa.string_view()}
        types["dictionary"] = pa.dictionary(pa.int32(), pa.string())
        fields = [pa.field(each.name, types[kind] if each.type == pa.string() else each.type) for each in table.schema]
        table = table.cast(pa.schema(fields))
        with pa.ipc.new_file(str(file), table.schema) as writer:
            writer.write_table(table)
    ingest(SAMPLE, tmp_path / "plain")
    ingest(source, tmp_path / "d")
    plain, found = (list(open_dataset(tmp_path / name).labels()) for name in ("plain", "d"))
    assert found == plain
    assert len(found) == 6
