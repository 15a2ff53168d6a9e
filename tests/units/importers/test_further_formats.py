"""KITTI, OpenLABEL, INTERACTION, motion forecasting: what they lack stays absent; what is unsound is left out."""

from __future__ import annotations

import cmath
import json
import math
import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scenicq.errors import DataError
from scenicq.geometry.network import Network
from scenicq.importers.base import ImportOptions
from scenicq.importers.ingest import IngestSummary, ingest
from scenicq.importers.interaction import Interaction
from scenicq.importers.lanelet2_map import utm
from scenicq.importers.report import Report
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label

SAMPLES = Path(__file__).parents[3] / "sample_data"


def copy(name: str, tmp_path: Path) -> Path:
    return Path(shutil.copytree(SAMPLES / name, tmp_path / "source"))


def read(source: Path, tmp_path: Path, **options: Any) -> tuple[list[Label], IngestSummary]:
    summary = ingest(source, tmp_path / "d", **options)
    return list(open_dataset(tmp_path / "d").labels()), summary


class TestKitti:
    def test_the_ego_has_no_size_and_dont_care_is_no_object(self, tmp_path: Path) -> None:
        labels, _ = read(SAMPLES / "kitti_tiny", tmp_path)
        assert [label.ego.width for label in labels] == [None] * 6
        assert [label.ego.x for label in labels] == pytest.approx([0, 1, 2, 3, 4, 5], abs=1e-6)
        assert labels[2].ego.velocity == pytest.approx((10, 0), abs=1e-5)
        assert {member.source_class for label in labels for member in label.objects} == {"Car", "Pedestrian"}
        assert labels[0].sensors == {"image_02": "training/image_02/0000/000000.png"}

    def test_without_poses_nothing_has_a_velocity(self, tmp_path: Path) -> None:
        source = copy("kitti_tiny", tmp_path)
        shutil.rmtree(source / "training" / "oxts")
        labels, summary = read(source, tmp_path)
        assert {member.velocity for label in labels for member in (label.ego, *label.objects)} == {None}
        assert {(label.ego.x, label.ego.y) for label in labels} == {(0.0, 0.0)}
        assert labels[1].objects[0].x == pytest.approx(38.2)
        assert any(entry.code == "file-missing" and entry.kept for entry in summary.left_out)

    @pytest.mark.parametrize("unit", ["says", "is silent", "has six columns"])
    def test_the_ego_is_as_fast_as_its_unit_says(self, tmp_path: Path, unit: str) -> None:
        """Towards east and north is the oracle for ahead and to the left."""
        draw = random.Random(unit)
        source = copy("kitti_tiny", tmp_path)
        poses = source / "training" / "oxts" / "0000.txt"
        rows: list[list[str]] = []
        moves: list[complex] = []
        for line in poses.read_text().splitlines():
            move, yaw = complex(draw.uniform(-20, 20), draw.uniform(-20, 20)), draw.uniform(-3, 3)
            own = move * cmath.exp(-1j * yaw)
            said = (move.imag, move.real, own.real, own.imag, 0.5) if unit == "says" else (0.0,) * 5
            row = [*line.split()[:3], "0", "0", repr(yaw), *map(repr, said), *["0"] * 19]
            rows.append(row[:6] if unit == "has six columns" else row)
            moves.append(move if unit == "says" else 10 + 0j)
        poses.write_text("".join(" ".join(row) + "\n" for row in rows))
        labels, _ = read(source, tmp_path)
        assert [complex(*label.ego.velocity) for label in labels] == pytest.approx(moves, abs=1e-4)

    @pytest.mark.parametrize("name", ["oxts", "calib"])
    def test_an_unsound_companion_leaves_the_sequence_out(self, tmp_path: Path, name: str) -> None:
        source = copy("kitti_tiny", tmp_path)
        (source / "training" / name / "0000.txt").write_text("1 2 x\n")
        with pytest.raises(DataError) as error:
            ingest(source, tmp_path / "d")
        assert "file-invalid" in {diagnostic.code for diagnostic in error.value.diagnostics}

    def test_frames_beyond_the_poses_are_left_out(self, tmp_path: Path) -> None:
        source = copy("kitti_tiny", tmp_path)
        poses = source / "training" / "oxts" / "0000.txt"
        poses.write_text("\n".join(poses.read_text().splitlines()[:4]))
        labels, summary = read(source, tmp_path)
        assert len(labels) == 4
        assert [entry.count for entry in summary.left_out if entry.what == "object"] == [4]

    def test_both_spellings_of_calibrations(self, tmp_path: Path) -> None:
        plain, _ = read(SAMPLES / "kitti_tiny", tmp_path)
        source = copy("kitti_tiny", tmp_path)
        file = source / "training" / "calib" / "0000.txt"
        text = file.read_text()
        for old, new in (
            ("R_rect", "R0_rect:"),
            ("Tr_velo_cam", "Tr_velo_to_cam:"),
            ("Tr_imu_velo", "Tr_imu_to_velo:"),
        ):
            assert old in text
            text = text.replace(old, new)
        file.write_text(text)
        (tmp_path / "d").rename(tmp_path / "plain")
        labels, _ = read(source, tmp_path)
        assert [label.objects for label in labels] == [label.objects for label in plain]
        file.write_text(text.replace("Tr_imu_to_velo", "Tr_other"))
        with pytest.raises(DataError, match="there is no `Tr_imu_velo` or `Tr_imu_to_velo`"):
            ingest(source, tmp_path / "e")


class TestOpenLabel:
    def edited(self, tmp_path: Path, edit: Callable[[dict[str, Any]], object]) -> Path:
        source = copy("openlabel_tiny", tmp_path)
        content = json.loads((source / "tiny.json").read_text())
        edit(content["openlabel"])
        (source / "tiny.json").write_text(json.dumps(content))
        return source

    def test_the_ego_is_the_vehicle_of_a_coordinate_system(self, tmp_path: Path) -> None:
        labels, _ = read(SAMPLES / "openlabel_tiny", tmp_path)
        assert [label.ego.x for label in labels] == pytest.approx([10, 11, 12, 13, 14, 15])
        assert {label.ego.length for label in labels} == {None}
        sizes = {(member.length, member.width, member.height) for label in labels for member in label.objects}
        assert sizes == {(4.5, 1.9, 1.6), (0.7, 0.6, 1.75)}
        assert [label.timestamp_us for label in labels] == [0, 100000, 200000, 300000, 400000, 500000]

    def test_without_a_vehicle_the_ego_is_chosen(self, tmp_path: Path) -> None:
        def edit(content: dict[str, Any]) -> None:
            content["coordinate_systems"] = {}
            for frame in content["frames"].values():
                for name in ("0", "1"):
                    del frame["objects"][name]["object_data"]["cuboid"][0]["coordinate_system"]
                    frame["objects"][name]["object_data"]["cuboid"][0]["val"][3:-3] = [0.0, 0.0, 1.0]

        labels, summary = read(self.edited(tmp_path, edit), tmp_path)
        assert {label.ego.track for label in labels} == {"0"}
        assert labels[0].ego.heading == pytest.approx(1 - math.pi / 2)
        assert any(entry.name == "no ego" for entry in summary.left_out)

    @pytest.mark.parametrize(
        "edit",
        [
            lambda content: content["coordinate_systems"]["odom"].update(parent="CAM_LEFT"),
            lambda content: content.update(frames=[]),
            lambda content: content.pop("frames"),
        ],
    )
    def test_unsound_files_end_in_diagnostics(self, tmp_path: Path, edit: Callable[[dict[str, Any]], object]) -> None:
        source = self.edited(tmp_path, edit)
        with pytest.raises(DataError) as error:
            ingest(source, tmp_path / "d")
        assert error.value.diagnostics[0].code == "dataset-empty"
        assert len(error.value.diagnostics) < 30

    def test_a_camera_without_a_sound_pose_has_no_objects(self, tmp_path: Path) -> None:
        def edit(content: dict[str, Any]) -> None:
            content["coordinate_systems"]["CAM_LEFT"]["pose_wrt_parent"]["matrix4x4"] = [0.0] * 16

        _, summary = read(self.edited(tmp_path, edit), tmp_path)
        assert summary.objects == 0
        assert [entry.count for entry in summary.left_out if entry.what == "object"] == [12]


class TestInteraction:
    @pytest.mark.parametrize("name", ["recorded_trackfiles/DR_X/vehicle_tracks_000.csv", "train/DR_X_train.csv"])
    def test_a_recording_a_case(self, name: str, tmp_path: Path) -> None:
        head = "case_id,track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,psi_rad,length,width,track_to_predict"
        lines = [head]
        # Cases need not be in one piece.
        for case, frames, x in (("1.0", (1, 2), 10), ("2.0", (1, 2), 50), ("1.0", (3,), 10)):
            for frame in frames:
                for track in (1, 2):
                    lines.append(f"{case},{track},{frame},{frame}00,car,{x + frame},{2 * track},1,0,0,4.5,1.8,1")
        file = tmp_path / "s" / name
        file.parent.mkdir(parents=True)
        file.write_text("\n".join(lines) + "\n")
        labels, summary = read(tmp_path / "s", tmp_path, ego="1")
        scene = "DR_X/train" if "train" in name else "DR_X/000"
        found = [(label.recording, label.timestamp_us, label.ego.x, len(label.objects)) for label in labels]
        assert found == [
            (f"{scene}/{case}", 100_000 * frame, x + frame, 1)
            for case, x, frames in (("1", 10, (1, 2, 3)), ("2", 50, (1, 2)))
            for frame in frames
        ]
        assert {entry.name: entry.count for entry in summary.left_out if entry.code == "not-read"} == {
            "track_to_predict": 10
        }

    def test_people_have_neither_heading_nor_size(self, tmp_path: Path) -> None:
        labels, _ = read(SAMPLES / "interaction_tiny", tmp_path, ego="1")
        walkers = [member for label in labels for member in label.objects if member.category == "Pedestrian"]
        assert {(member.heading, member.width, member.length) for member in walkers} == {(None, None, None)}
        assert walkers[0].velocity == (0.0, 1.5)
        assert {label.ego.track for label in labels} == {"1"}
        assert [label.timestamp_us for label in labels][:2] == [100_000, 200_000]

    def test_lanelets(self) -> None:
        source = Interaction().read(SAMPLES / "interaction_tiny", ImportOptions(), Report())
        network = Network("TINY_Street", source.maps["TINY_Street"])
        lanes = {lane.id: lane for lane in network.lanes}
        # All four share their left line with the opposite lane, which runs backwards for two of them.
        assert network.roadDirection.values(30, -1) == pytest.approx((-math.pi / 2,), abs=1e-6)
        assert network.roadDirection.values(30, 1) == pytest.approx((math.pi / 2,), abs=1e-6)
        assert [lane.id for lane in lanes["1"].successors] == ["3"]
        assert lanes["1"].group is not None
        assert lanes["1"].group.opposite is lanes["2"].group
        assert len(network.intersections) == 1
        assert lanes["1"].polygon.area == pytest.approx(60 * 3.5, rel=1e-4)

    @pytest.mark.parametrize(
        ("place", "east", "north"),
        # By the definition of the grid: 500 km less at the zone's middle; the quadrant to 45 degrees there.
        [((0.0, 3.0), 333_978.556, 0.0), ((45.0, 3.0), 333_978.556, 4_982_950.400)],
    )
    def test_projection(self, place: tuple[float, float], east: float, north: float) -> None:
        assert utm(*place) == pytest.approx((east, north), abs=0.01)

    def test_a_wrong_table_is_a_diagnostic(self, tmp_path: Path) -> None:
        source = copy("interaction_tiny", tmp_path)
        next(source.rglob("vehicle_tracks_000.csv")).write_text("a,b\n1,2\n")
        with pytest.raises(DataError, match="lacks the columns"):
            ingest(source, tmp_path / "d")


class TestForecasting:
    def test_nothing_has_a_size(self, tmp_path: Path) -> None:
        labels, _ = read(SAMPLES / "forecasting_tiny", tmp_path)
        assert {member.length for label in labels for member in (label.ego, *label.objects)} == {None}
        assert labels[3].ego.x == pytest.approx(13)
        assert len(open_dataset(tmp_path / "d").network(labels[0].map).lanes) == 4

    def test_another_schema_is_a_diagnostic(self, tmp_path: Path) -> None:
        source = copy("forecasting_tiny", tmp_path)
        pq.write_table(pa.table({"x": [1]}), next(source.rglob("*.parquet")))
        with pytest.raises(DataError, match="lacks the columns"):
            ingest(source, tmp_path / "d")

    def test_frames_without_the_ego_are_left_out(self, tmp_path: Path) -> None:
        source = copy("forecasting_tiny", tmp_path)
        file = next(source.rglob("*.parquet"))
        rows = [row for row in pq.read_table(file).to_pylist() if row["track_id"] != "AV" or row["timestep"] != 2]
        pq.write_table(pa.Table.from_pylist(rows), file)
        labels, summary = read(source, tmp_path)
        assert len(labels) == 5
        assert [entry.count for entry in summary.left_out if entry.what == "label"] == [1]
