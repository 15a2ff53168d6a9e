"""Cameras, heights and tilts, from each source that has them to the store, and from there to an interchange folder."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet as pq
import pytest

from scenicq.errors import DataError
from scenicq.exporters.interchange import write_interchange
from scenicq.geometry.camera import Camera, box_corners, box_edges
from scenicq.importers.ingest import ingest
from scenicq.importers.motion import pose_of_quaternion
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, OutOfPlane, Recording
from scenicq.store.rules import check_part
from scenicq.store.writer import write_dataset

SAMPLES = Path(__file__).parents[3] / "sample_data"
LOG = "5ce0c0de-0000-4000-8000-000000000001"
# of a camera that looks ahead, in the frame of its vehicle: x to the right is -y, y down -z, z ahead x
AHEAD = (0.5, -0.5, 0.5, -0.5)
SEEN = Camera(640, 360, (500.0, 510.0, 320.0, 180.0), (1.0, 2.0, 1.5), AHEAD)


def taken(source: Path, folder: Path) -> Dataset:
    ingest(source, folder)
    return open_dataset(folder)


def rewrite(file: Path, change: Any) -> None:
    rows = json.loads(file.read_text())
    for row in rows:
        change(row)
    file.write_text(json.dumps(rows))


@pytest.fixture
def nuscenes(tmp_path: Path) -> Path:
    """The tiny sample, its camera calibrated."""
    source = Path(shutil.copytree(SAMPLES / "nuscenes_tiny", tmp_path / "source"))
    tables = source / "v1.0-tiny"
    names = {row["token"]: row["channel"] for row in json.loads((tables / "sensor.json").read_text())}

    def calibrate(row: dict[str, Any]) -> None:
        if names[row["sensor_token"]].startswith("CAM"):
            row |= {"camera_intrinsic": [[500, 0, 320], [0, 510, 180], [0, 0, 1]], "rotation": list(AHEAD)}

    rewrite(tables / "calibrated_sensor.json", calibrate)
    rewrite(tables / "sample_data.json", lambda row: row.update(width=640, height=360))
    return source


def test_cameras_of_nuscenes(nuscenes: Path, tmp_path: Path) -> None:
    """A camera is where the ego was when the image was taken, turned as it is mounted."""
    tables = nuscenes / "v1.0-tiny"
    poses = {row["token"]: row for row in json.loads((tables / "ego_pose.json").read_text())}
    files = {row["filename"]: row for row in json.loads((tables / "sample_data.json").read_text())}
    (mount,) = [r for r in json.loads((tables / "calibrated_sensor.json").read_text()) if r["camera_intrinsic"]]
    for label in taken(nuscenes, tmp_path / "d").labels():
        assert set(label.cameras) == {"CAM_FRONT"}
        camera, row = label.cameras["CAM_FRONT"], poses[files[label.sensors["CAM_FRONT"]]["ego_pose_token"]]
        vehicle = pose_of_quaternion(*row["rotation"], tuple(row["translation"]))
        expected = vehicle.compose(pose_of_quaternion(*AHEAD, tuple(mount["translation"])))
        found = pose_of_quaternion(*camera.rotation, camera.position)
        for axis in ("x", "y", "z", "origin"):
            assert getattr(found, axis) == pytest.approx(getattr(expected, axis))
        assert camera[:3] == (640, 360, (500, 510, 320, 180))


def test_heights_of_nuscenes(nuscenes: Path, tmp_path: Path) -> None:
    rows = json.loads((nuscenes / "v1.0-tiny" / "sample_annotation.json").read_text())
    heights = {row["token"]: row["translation"][2] for row in rows}
    for label in taken(nuscenes, tmp_path / "d").labels():
        assert label.ego.out_of_plane is not None
        for thing in label.objects:
            assert thing.out_of_plane == OutOfPlane(heights[thing.id])


@pytest.mark.parametrize(
    "change",
    [
        {"camera_intrinsic": [[500, 0, 320], [0, 510, 180]]},
        {"camera_intrinsic": [["x", 0, 320], [0, 510, 180], [0, 0, 1]]},
        {"camera_intrinsic": [[-500, 0, 320], [0, 510, 180], [0, 0, 1]]},
        {"camera_intrinsic": [[500, 0, 320], [0, 510, 180], [0, 0, 1]], "rotation": [0, 0, 0, 0]},
    ],
)
def test_a_camera_that_cannot_be_is_left_out_alone(nuscenes: Path, tmp_path: Path, change: dict[str, Any]) -> None:
    rewrite(
        nuscenes / "v1.0-tiny" / "calibrated_sensor.json",
        lambda row: row.update(change if row["camera_intrinsic"] else {}),
    )
    summary = ingest(nuscenes, tmp_path / "d")
    assert {(each.what, each.code) for each in summary.left_out if each.what == "camera"} == {
        ("camera", "record-invalid")
    }
    labels = list(open_dataset(tmp_path / "d").labels())
    assert labels
    assert all("CAM_FRONT" in label.sensors and not label.cameras for label in labels)


@pytest.fixture
def argoverse(tmp_path: Path) -> Path:
    """The tiny log with one calibrated camera, whose images are empty files."""
    source = Path(shutil.copytree(SAMPLES / "argoverse2_tiny", tmp_path / "source"))
    log = source / "val" / LOG
    images = log / "sensors" / "cameras" / "ring_front_center"
    images.mkdir(parents=True)
    times = pyarrow.feather.read_table(log / "city_SE3_egovehicle.feather")["timestamp_ns"].to_pylist()
    for time in times:
        (images / f"{time}.jpg").touch()
    (log / "calibration").mkdir()
    seen = {"sensor_name": ["ring_front_center"], "fx_px": [500.0], "fy_px": [510.0], "cx_px": [320.0],
            "cy_px": [180.0], "k1": [0.0], "width_px": [640], "height_px": [360]}  # fmt: skip
    mounted = {"sensor_name": ["ring_front_center"], "qw": [0.5], "qx": [-0.5], "qy": [0.5], "qz": [-0.5],
               "tx_m": [1.5], "ty_m": [0.0], "tz_m": [1.4]}  # fmt: skip
    pyarrow.feather.write_feather(pa.table(seen), str(log / "calibration" / "intrinsics.feather"))
    pyarrow.feather.write_feather(pa.table(mounted), str(log / "calibration" / "egovehicle_SE3_sensor.feather"))
    return source


def test_cameras_of_argoverse(argoverse: Path, tmp_path: Path) -> None:
    poses = pyarrow.feather.read_table(argoverse / "val" / LOG / "city_SE3_egovehicle.feather").to_pylist()
    by_time = {row["timestamp_ns"]: row for row in poses}
    for label in taken(argoverse, tmp_path / "d").labels():
        row = by_time[int(label.frame.rpartition("/")[2])]
        turn = (row[f"q{axis}"] for axis in "wxyz")
        vehicle = pose_of_quaternion(*turn, (row["tx_m"], row["ty_m"], row["tz_m"]))
        camera = label.cameras["ring_front_center"]
        assert camera.position == pytest.approx(vehicle.transform_point((1.5, 0.0, 1.4)))
        assert pose_of_quaternion(*camera.rotation, (0, 0, 0)).z == pytest.approx(vehicle.x)
        space = label.ego.out_of_plane
        assert space is not None
        assert (space.pitch, space.roll) == pytest.approx((vehicle.pitch, vehicle.roll))


@pytest.mark.parametrize("damage", ["nothing", "text", "column"])
def test_a_calibration_that_cannot_be_read_is_left_out(argoverse: Path, tmp_path: Path, damage: str) -> None:
    file = argoverse / "val" / LOG / "calibration" / "intrinsics.feather"
    match damage:
        case "text":
            file.write_text("no feather")
        case "column":
            table = pyarrow.feather.read_table(file)
            pyarrow.feather.write_feather(table.drop_columns(["fx_px"]), str(file))
        case _:
            pass
    summary = ingest(argoverse, tmp_path / "d")
    labels = list(open_dataset(tmp_path / "d").labels())
    assert labels
    assert any(each.what == "camera" for each in summary.left_out) == (damage != "nothing")
    assert all(bool(label.cameras) == (damage == "nothing") for label in labels)


def seen_label(**more: Any) -> Label:
    ego = LabelObject("ego", "Car", "car", 0.0, 0.0, 0.0, out_of_plane=OutOfPlane(0.3, 0.01, -0.02))
    car = LabelObject("a", "Car", "car", 0.0, 20.0, 0.0, 2.0, 4.0, 1.5, out_of_plane=OutOfPlane(0.8))
    plain = LabelObject("b", "Car", "car", 5.0, 20.0, 0.0)
    sensors = {"CAM": "a.jpg", "LIDAR": "b.bin"}
    return Label("f", "r", 0, "none", ego, (car, plain), sensors=sensors, cameras={"CAM": SEEN, **more})


def test_an_interchange_folder_keeps_them(tmp_path: Path) -> None:
    label = seen_label()
    write_dataset(tmp_path / "d", [Recording("r", "none", (label,))], {}, name="d")
    first = open_dataset(tmp_path / "d")
    assert list(first.labels()) == [label]
    (tmp_path / "out").mkdir()
    write_interchange(first, ["f"], tmp_path / "out")
    assert list(taken(tmp_path / "out", tmp_path / "again").labels()) == [label]


def test_a_camera_of_an_interchange_folder_that_cannot_be_is_left_out(tmp_path: Path) -> None:
    write_dataset(tmp_path / "d", [Recording("r", "none", (seen_label(),))], {}, name="d")
    (tmp_path / "out").mkdir()
    write_interchange(open_dataset(tmp_path / "d"), ["f"], tmp_path / "out")
    file = tmp_path / "out" / "labels.jsonl"
    line = json.loads(file.read_text())
    line["sensors"]["CAM"]["rotation"] = [0, 0, 0, 0]
    file.write_text(json.dumps(line) + "\n")
    summary = ingest(tmp_path / "out", tmp_path / "again")
    assert [each.code for each in summary.left_out if each.what == "camera"] == ["record-invalid"]
    (label,) = open_dataset(tmp_path / "again").labels()
    assert label.sensors == {"CAM": "a.jpg", "LIDAR": "b.bin"}
    assert not label.cameras


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("image_height", None),
        ("intrinsics", [1.0, 2.0]),
        ("intrinsics", [0.0, 1.0, 1.0, 1.0]),
        ("camera_pose", []),
        ("camera_pose", [0.0] * 7),
        ("camera_pose", [1e9, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
    ],
)
def test_rows_that_hold_no_camera_are_refused(tmp_path: Path, column: str, value: Any) -> None:
    write_dataset(tmp_path / "d", [Recording("r", "none", (seen_label(),))], {}, name="d")
    dataset = open_dataset(tmp_path / "d")
    names = ("labels", "objects", "memberships", "sensors")
    tables = {name: pq.read_table(dataset.path / dataset.manifest.tables[name][0].path) for name in names}
    check_part(tables, {name: name for name in names}, ["none"])
    rows = tables["sensors"]
    values = rows[column].to_pylist()
    values[0] = value
    place = rows.column_names.index(column)
    tables["sensors"] = rows.set_column(place, rows.schema.field(column), pa.array(values, rows.schema.types[place]))
    with pytest.raises(DataError) as refused:
        check_part(tables, {name: name for name in names}, ["none"])
    assert refused.value.diagnostics[0].code == "dataset-invalid"


def test_a_labelled_car_ahead_is_seen_by_the_camera_of_its_frame(nuscenes: Path, tmp_path: Path) -> None:
    """The car nearest to the middle of the way ahead lies in the image, the one behind does not."""
    label = next(taken(nuscenes, tmp_path / "d").labels())
    heading = label.ego.heading
    assert heading is not None
    for thing in label.objects:
        dx, dy = thing.x - label.ego.x, thing.y - label.ego.y
        ahead = -math.sin(heading) * dx + math.cos(heading) * dy
        right = math.cos(heading) * dx + math.sin(heading) * dy
        assert thing.out_of_plane is not None
        assert thing.heading is not None
        corners = box_corners(
            (thing.x, thing.y, thing.out_of_plane.z or 0.0),
            (thing.width or 0.0, thing.length or 0.0, thing.height or 0.0),
            thing.heading, 0.0, 0.0,
        )  # fmt: skip
        lines = box_edges(label.cameras["CAM_FRONT"], corners)
        if ahead < -5:
            assert not len(lines)
        if ahead > 8 and abs(right) < 0.3 * ahead:
            assert len(lines) == 12
