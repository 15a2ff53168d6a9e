"""OpenLABEL as its specification says, against matrices that are multiplied here."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from scenicq.importers.ingest import IngestSummary, ingest
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label

Matrix = NDArray[np.float64]
SIZE = [4.5, 1.9, 1.6]


def read(content: dict[str, Any] | dict[str, dict[str, Any]], tmp_path: Path) -> tuple[list[Label], IngestSummary]:
    """Labels of a file, or of several by name."""
    source = tmp_path / "s"
    source.mkdir()
    files = content if all(name.endswith(".json") for name in content) else {"file.json": content}
    for name, each in files.items():
        (source / name).write_text(json.dumps({"openlabel": {"metadata": {"schema_version": "1.0.0"}, **each}}))
    summary = ingest(source, tmp_path / "d", force=True)
    return list(open_dataset(tmp_path / "d").labels()), summary


def cuboid(x: float, y: float = 0.0, *, yaw: float = 0.0, **more: Any) -> dict[str, Any]:
    return {"cuboid": [{"name": "box", "val": [x, y, 0.8, 0.0, 0.0, yaw, *SIZE], **more}]}


def system(parent: str = "", **more: Any) -> dict[str, Any]:
    return {"type": "local_cs", "parent": parent, "children": [], **more}


def shift(x: float, y: float = 0.0) -> dict[str, Any]:
    return {"matrix4x4": [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, 0, 0, 0, 0, 1]}


def places(labels: list[Label]) -> list[list[tuple[str, float, float]]]:
    return [sorted((each.id, round(each.x, 6), round(each.y, 6)) for each in label.objects) for label in labels]


def names(summary: IngestSummary, code: str) -> dict[str, int]:
    return {entry.name: entry.count for entry in summary.left_out if entry.code == code}


def _about(axis: str, angle: float) -> Matrix:
    c, s = math.cos(angle), math.sin(angle)
    rows = {
        "X": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "Y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "Z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }
    return np.array(rows[axis], dtype=float)


def _random_pose(random: np.random.Generator) -> tuple[Matrix, dict[str, Any]]:
    """A pose as a matrix, and one of the forms in which a file can say it."""
    place = random.uniform(-50, 50, 3)
    form = random.integers(3)
    if form == 0:
        sequence = str(random.choice(["ZYX", "XYZ", "ZXY", "YZX"]))
        angles = random.uniform(-1.2, 1.2, 3)
        turn = np.linalg.multi_dot([_about(axis, angle) for axis, angle in zip(sequence, angles, strict=True)])
        said: dict[str, Any] = {"euler_angles": angles.tolist(), "translation": place.tolist()}
        if sequence != "ZYX" or random.random() < 0.5:
            said["sequence"] = sequence
    else:
        yaw = float(random.uniform(-3, 3))
        turn = _about("Z", yaw)
        said = {"quaternion": [0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)], "translation": place.tolist()}
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = turn, place
    return whole, {"matrix4x4": whole.ravel().tolist()} if form == 2 else said


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.one_in(12)
def test_trees_of_coordinate_systems(seed: int, tmp_path: Path) -> None:
    random = np.random.default_rng(seed)
    count = int(random.integers(2, 7))
    parents = {f"s{n}": f"s{random.integers(n)}" if n else "" for n in range(count)}
    systems: dict[str, Any] = {}
    fixed: dict[str, Matrix] = {"s0": np.eye(4)}
    for name, parent in parents.items():
        systems[name] = system(parent)
        if parent:
            fixed[name], systems[name]["pose_wrt_parent"] = _random_pose(random)
    frames: dict[str, Any] = {}
    expected: list[list[tuple[str, float, float, float]]] = []
    homes = {str(n): str(random.choice(list(parents))) for n in range(3)}
    objects = {key: {"name": f"o{key}", "type": "car", "coordinate_system": home} for key, home in homes.items()}
    for number in range(3):
        edges = dict(fixed)
        transforms: dict[str, Any] = {}
        for name, parent in parents.items():
            if not parent or random.random() < 0.5:
                continue
            pose, said = _random_pose(random)
            if random.random() < 0.5:
                edges[name] = pose
                transforms[f"{name}_to_{parent}"] = {"src": name, "dst": parent, "transform_src_to_dst": said}
            else:
                edges[name] = np.linalg.inv(pose)
                transforms[f"{parent}_to_{name}"] = {"src": parent, "dst": name, "transform_src_to_dst": said}
        row: list[tuple[str, float, float, float]] = []
        members: dict[str, Any] = {}
        for key, usual in homes.items():
            home = str(random.choice(list(parents))) if random.random() < 0.3 else usual
            x, y, z, yaw = (float(value) for value in random.uniform(-3, 3, 4))
            box = [x, y, z, 0.0, 0.0, yaw, *SIZE]
            where = {} if home == usual else {"coordinate_system": home}
            members[key] = {"object_data": {"cuboid": [{"name": "box", "val": box, **where}]}}
            whole = np.eye(4)
            while parents[home]:
                whole, home = edges[home] @ whole, parents[home]
            place = whole @ np.array([x, y, z, 1.0])
            ahead = whole[:3, :3] @ _about("Z", yaw)[:, 0]
            row.append((key, place[0], place[1], math.atan2(-ahead[0], ahead[1])))
        frames[str(number)] = {
            "objects": members,
            "frame_properties": {"timestamp": number / 10, "transforms": transforms},
        }
        expected.append(row)
    labels, _ = read({"coordinate_systems": systems, "objects": objects, "frames": frames}, tmp_path)
    for label, row in zip(labels, expected, strict=True):
        found = {each.track or each.id: each for each in (label.ego, *label.objects)}
        for key, x, y, heading in row:
            member = found[key]
            assert (member.x, member.y) == pytest.approx((x, y), abs=1e-6)
            assert member.heading is not None
            assert math.remainder(member.heading - heading, 2 * math.pi) == pytest.approx(0, abs=1e-6)


def test_data_of_an_object_hold_in_all_its_frames(tmp_path: Path) -> None:
    content = {
        "coordinate_systems": {"odom": system(), "vehicle": system("odom", pose_wrt_parent=shift(0))},
        "objects": {
            "0": {"name": "moves", "type": "car"},
            "1": {"name": "stands", "type": "car", "object_data": cuboid(20, 5)},
            "2": {"name": "leaves", "type": "car", "object_data": cuboid(30),
                  "frame_intervals": [{"frame_start": 0, "frame_end": 1}]},
        },
        "frames": {str(n): {"objects": {"0": {"object_data": cuboid(10 + n)}}} for n in range(3)},
    }  # fmt: skip
    labels, summary = read(content, tmp_path)
    assert places(labels) == [
        [("0", 10, 0), ("1", 20, 5), ("2", 30, 0)],
        [("0", 11, 0), ("1", 20, 5), ("2", 30, 0)],
        [("0", 12, 0), ("1", 20, 5)],
    ]
    assert names(summary, "assumed") == {"steps of 0.1 s": 1, "an ego at rest": 1, "no map": 1}


def test_a_file_without_frames_is_one(tmp_path: Path) -> None:
    content = {"objects": {"0": {"name": "car", "type": "car", "object_data": cuboid(20, 5)}}}
    labels, _ = read(content, tmp_path)
    assert [(label.frame, label.ego.x) for label in labels] == [("file/0", 20)]


def _frames(count: int, properties: Callable[[int], dict[str, Any]]) -> dict[str, Any]:
    return {
        "objects": {"0": {"name": "car", "type": "car"}},
        "frames": {
            str(n): {"objects": {"0": {"object_data": cuboid(n)}}, "frame_properties": properties(n)}
            for n in range(count)
        },
    }


@pytest.mark.parametrize(
    ("properties", "times"),
    [
        (lambda n: {"timestamp": 10 + n}, [10_000_000, 11_000_000, 12_000_000]),
        (lambda n: {"timestamp": f"{n}.5"}, [500_000, 1_500_000, 2_500_000]),
        (lambda n: {"timestamp": f"2020-04-11 12:00:0{n}"}, [1586606400000000 + n * 1_000_000 for n in range(3)]),
        (
            lambda n: {"streams": {"cam": {"stream_properties": {"sync": {"frame_stream": n, "timestamp": n}}}}},
            [0, 1_000_000, 2_000_000],
        ),
        (
            lambda n: {"timestamp": n, "streams": {"cam": {"stream_properties": {"sync": {"timestamp": 9}}}}},
            [0, 1_000_000, 2_000_000],
        ),
        (lambda n: {}, [0, 100_000, 200_000]),
        (lambda n: {"timestamp": n} if n else {}, [1_000_000, 2_000_000]),
    ],
)
def test_times(properties: Callable[[int], dict[str, Any]], times: list[int], tmp_path: Path) -> None:
    labels, summary = read(_frames(3, properties), tmp_path)
    assert [label.timestamp_us for label in labels] == times
    left = [entry.count for entry in summary.left_out if entry.what == "label" and not entry.kept]
    assert left == ([1] if len(times) < 3 else [])
    assert ("steps of 0.1 s" in names(summary, "assumed")) == (times == [0, 100_000, 200_000])


def test_files_of_one_frame_each_are_a_recording(tmp_path: Path) -> None:
    # So write recorders at the roadside: what the object is stands in the frame, and brackets are left out.
    def frame(n: int) -> dict[str, Any]:
        box = {"name": "shape3D", "val": [10.0 + n, 0, 0.8, 0, 0, 0, 1, *SIZE]}
        data = {"name": "CAR_1", "type": "CAR", "cuboid": box}
        return {"frames": {"7": {"objects": {"a": {"object_data": data}}, "frame_properties": {"timestamp": n / 10}}}}

    labels, _ = read({f"{9 - n:03}.json": frame(n) for n in range(3)}, tmp_path)
    assert {label.recording for label in labels} == {"s"}
    assert [(label.ego.x, label.ego.track, label.ego.source_class) for label in labels] == [
        (10, "a", "CAR"), (11, "a", "CAR"), (12, "a", "CAR")
    ]  # fmt: skip
    assert {label.ego.category for label in labels} == {"Car"}


@pytest.mark.parametrize("called", ["egocar", "Egocar", "ego_vehicle", "EGO", "ego-vehicle"])
@pytest.mark.parametrize("key", ["name", "type"])
def test_an_object_that_is_the_ego_is_no_object_on_it(called: str, key: str, tmp_path: Path) -> None:
    content = {
        "coordinate_systems": {"odom": system(), "vehicle": system("odom")},
        "objects": {"0": {"name": "car", "type": "car"}, "1": {"name": "x", "type": "car", key: called}},
        "frames": {
            str(n): {
                "objects": {"0": {"object_data": cuboid(10)}, "1": {"object_data": cuboid(n)}},
                "frame_properties": {"timestamp": n},
            }
            for n in range(2)
        },
    }
    labels, _ = read(content, tmp_path)
    assert [(label.ego.x, label.ego.length, label.ego.category) for label in labels] == [
        (0, 4.5, "Car"), (1, 4.5, "Car")
    ]  # fmt: skip
    assert places(labels) == [[("0", 10, 0)]] * 2


def test_what_is_not_read_is_counted(tmp_path: Path) -> None:
    content = {
        "coordinate_systems": {"odom": system()},
        "objects": {"0": {"name": "car", "type": "car"}, "1": {"name": "", "type": "DontCare"}},
        "actions": {"0": {"name": "a", "type": "turns"}},
        "frames": {
            "0": {
                "objects": {
                    "0": {
                        "object_data": {
                            "cuboid": [*cuboid(1)["cuboid"], *cuboid(2)["cuboid"]],
                            "bbox": [{"name": "b", "val": [0, 0, 1, 1]}] * 2,
                            "num": [{"name": "score", "val": 0.5}],
                            "vendor": 1,
                        }
                    },
                    "1": {"object_data": {"bbox": [{"name": "b", "val": [0, 0, 1, 1]}]}},
                },
                "actions": {"0": {}},
                "events": {"0": {}},
            }
        },
    }
    labels, summary = read(content, tmp_path)
    assert labels[0].ego.attributes == {"score": 0.5}
    assert names(summary, "not-read") == {
        "actions": 1,
        "frames/*/actions": 1,
        "frames/*/events": 1,
        "objects/* of the type DontCare": 1,
        "objects/*/object_data/bbox": 3,
        "objects/*/object_data/cuboid after the first": 1,
        "objects/*/object_data/vendor": 1,
    }
