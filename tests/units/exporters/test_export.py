"""Exports: what each form holds, that it is whole or absent, and that interchange gives the same tables back."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow.feather
import pytest

from scenicq.errors import DataError
from scenicq.exporters.export import EXPORTS, Exporter
from scenicq.exporters.forms import FORMS
from scenicq.importers.ingest import ingest
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown
from scenicq.query.execution.results import Result
from scenicq.store.dataset import Dataset, open_dataset

SAMPLES = Path(__file__).parents[3] / "sample_data"
REAL = Path(__file__).parents[4] / "shared" / "data"


def dataset_of(name: str, tmp_path: Path) -> Dataset:
    ingest(SAMPLES / name, tmp_path / "dataset")
    return open_dataset(tmp_path / "dataset")


def results(dataset: Dataset) -> list[Result]:
    """A match in every frame: the first object is `other`."""
    found: list[Result] = []
    for label in dataset.labels():
        verdict = Match({"ego": "ego", "other": label.objects[0].id}, {})
        found.append(Result(label.frame, label.recording, label.timestamp_us, verdict, label.sensors))
    return found


def export(kind: str, dataset: Dataset, taken: list[Result], target: Path) -> dict[str, str]:
    exporter = Exporter(kind, dataset, target, "crossing")
    for result in taken:
        exporter.add(result)
    summary = exporter.finish()
    assert summary.frames == sum(isinstance(result.verdict, Match) for result in taken)
    assert set(summary.files) == {path.relative_to(target).as_posix() for path in target.rglob("*") if path.is_file()}
    assert [path.name for path in target.parent.iterdir() if path.name.endswith(".tmp")] == []
    return {name: (target / name).read_text(errors="replace") for name in summary.files}


@pytest.mark.parametrize("name", ["crossroads", "nuscenes_tiny", "argoverse2_tiny"])
def test_interchange_gives_the_same_tables(name: str, tmp_path: Path) -> None:
    dataset = dataset_of(name, tmp_path)
    export("interchange", dataset, results(dataset), tmp_path / "out")
    ingest(tmp_path / "out", tmp_path / "again", strict=True)
    again = open_dataset(tmp_path / "again")
    assert again.manifest.tables == dataset.manifest.tables
    assert again.manifest.by_class == dataset.manifest.by_class


@pytest.mark.skipif(not (REAL / "nuscenes-mini").exists(), reason="nuScenes is not on this machine")
@pytest.mark.slow
def test_interchange_of_the_real_nuscenes(tmp_path: Path) -> None:
    map_ = REAL / "boston" / "maps" / "boston-seaport.geojson"
    ingest(REAL / "nuscenes-mini", tmp_path / "dataset", maps=[map_])
    dataset = open_dataset(tmp_path / "dataset")
    export("interchange", dataset, results(dataset), tmp_path / "out")
    ingest(tmp_path / "out", tmp_path / "again")
    assert open_dataset(tmp_path / "again").manifest.tables == dataset.manifest.tables


def test_interchange_of_some_frames(tmp_path: Path) -> None:
    dataset = dataset_of("crossroads", tmp_path)
    some = results(dataset)[10:40:7]
    export("interchange", dataset, some, tmp_path / "out")
    ingest(tmp_path / "out", tmp_path / "again", strict=True)
    wanted = [result.frame for result in some]
    assert list(open_dataset(tmp_path / "again").labels()) == list(dataset.labels(wanted))


def test_nuscenes_tokens(tmp_path: Path) -> None:
    dataset = dataset_of("nuscenes_tiny", tmp_path)
    taken = results(dataset)[:2]
    files = export("nuscenes-tokens", dataset, taken, tmp_path / "out")
    assert files["tokens.txt"].splitlines() == [result.frame for result in taken]
    assert json.loads(files["splits.json"]) == {"crossing": ["scene-0001"]}
    first = json.loads(files["matches.json"])[0]
    samples = json.loads((SAMPLES / "nuscenes_tiny" / "v1.0-tiny" / "sample.json").read_text())
    boxes = json.loads((SAMPLES / "nuscenes_tiny" / "v1.0-tiny" / "sample_annotation.json").read_text())
    assert first["sample_token"] in {row["token"] for row in samples}
    assert first["roles"]["other"] in {row["token"] for row in boxes if row["sample_token"] == first["sample_token"]}


def test_argoverse2_table(tmp_path: Path) -> None:
    dataset = dataset_of("argoverse2_tiny", tmp_path)
    export("argoverse2", dataset, results(dataset)[:2], tmp_path / "out")
    rows = pyarrow.feather.read_table(tmp_path / "out" / "matches.feather").to_pylist()
    annotations = next((SAMPLES / "argoverse2_tiny").rglob("annotations.feather"))
    known = {(row["timestamp_ns"], row["track_uuid"]) for row in pyarrow.feather.read_table(annotations).to_pylist()}
    assert [row["role"] for row in rows] == ["ego", "other"] * 2
    assert {(row["timestamp_ns"], row["track_uuid"]) for row in rows if row["role"] == "other"} <= known
    assert {row["log_id"] for row in rows} == {annotations.parent.name}


def test_paths_are_relative_and_unique(tmp_path: Path) -> None:
    dataset = dataset_of("nuscenes_tiny", tmp_path)
    files = export("paths", dataset, results(dataset), tmp_path / "out")
    lines = files["files.txt"].splitlines()
    assert len(lines) == len(set(lines)) == 12
    assert "samples/CAM_FRONT/scene-0001-0" in lines


def test_paths_that_climb_out_are_left_out(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    (source / "dataset.json").write_text('{"interchange": 1, "angle": "yaw", "classes": "scenic"}')
    line = {"id": "a", "recording": "r", "timestamp_us": 1, "map": "m", "ego": {"position": [0, 0], "yaw": 0}}
    line["objects"] = [{"id": "o", "class": "Car", "position": [1, 1], "yaw": 0}]
    line["sensors"] = {"A": "../../etc/passwd", "B": "/etc/passwd", "C": "fine.jpg", "D": "two\nlines"}
    (source / "labels.jsonl").write_text(json.dumps(line))
    ingest(source, tmp_path / "dataset")
    dataset = open_dataset(tmp_path / "dataset")
    exporter = Exporter("paths", dataset, tmp_path / "out")
    exporter.add(results(dataset)[0])
    assert len(exporter.finish().left_out) == 1
    assert (tmp_path / "out" / "files.txt").read_text() == "fine.jpg\n"


def test_openlabel_has_a_tag_a_match_and_roles(tmp_path: Path) -> None:
    dataset = dataset_of("nuscenes_tiny", tmp_path)
    files = export("openlabel", dataset, results(dataset), tmp_path / "out")
    assert len(files) == 2
    content = json.loads(next(iter(files.values())))["openlabel"]
    assert len(content["tags"]) == len(content["frames"]) == 3
    assert content["metadata"]["schema_version"] == "1.0.0"
    label = next(iter(dataset.labels()))
    (key,) = [key for key, each in content["objects"].items() if each["name"] == label.objects[0].track]
    other = content["frames"]["0"]["objects"][key]["object_data"]
    assert {"name": "role", "val": "other"} in other["text"]
    box = other["cuboid"][0]["val"]
    assert box[:2] == [label.objects[0].x, label.objects[0].y]
    assert box[6:8] == [label.objects[0].length, label.objects[0].width]


UID = "-?[0-9]+|[0-9a-fA-F]{8}(-[0-9a-fA-F]{4}){3}-[0-9a-fA-F]{12}"
VALUES = {"text": str, "num": int | float, "boolean": bool, "vec": list, "cuboid": list}


def _check_values(data: Mapping[str, Any], kinds: set[str]) -> None:
    assert set(data) <= kinds
    for kind, entries in data.items():
        for each in entries:
            assert isinstance(each["name"], str)
            assert isinstance(each["val"], VALUES[kind])
            if kind in ("vec", "cuboid"):
                assert all(isinstance(value, int | float) for value in each["val"])
                assert kind == "vec" or len(each["val"]) in (9, 10)


@pytest.mark.parametrize("source", ["nuscenes_tiny", "argoverse2_tiny", "crossroads"])
def test_openlabel_has_the_keys_that_the_schema_demands(tmp_path: Path, source: str) -> None:
    """What version 1.0.0 of the published schema requires and allows of all that is written."""
    dataset = dataset_of(source, tmp_path)
    for text in export("openlabel", dataset, results(dataset), tmp_path / "out").values():
        (root,) = (whole := json.loads(text)).values()
        assert set(whole) == {"openlabel"}
        assert set(root) == {
            *("metadata", "ontologies", "coordinate_systems", "objects", "frames", "frame_intervals", "tags"),
        }
        assert root["metadata"]["schema_version"] == "1.0.0"
        for group in ("objects", "ontologies", "tags"):
            assert all(re.fullmatch(UID, key) for key in root[group])
        assert all(set(each) == {"name", "type"} for each in root["objects"].values())
        assert all({"type", "parent"} <= set(each) for each in root["coordinate_systems"].values())
        assert all(set(each) == {"frame_start", "frame_end"} for each in root["frame_intervals"])
        for key, frame in root["frames"].items():
            assert key.isdecimal()
            assert set(frame) == {"objects", "frame_properties"}
            assert isinstance(frame["frame_properties"]["timestamp"], str)
            streams = frame["frame_properties"].get("streams", {})
            assert all(set(each) == {"uri"} for each in streams.values())
            for name, member in frame["objects"].items():
                assert re.fullmatch(UID, name)
                assert name in root["objects"]
                assert set(member) == {"object_data"}
                _check_values(member["object_data"], set(VALUES))
        for tag in root["tags"].values():
            assert isinstance(tag["type"], str)
            assert tag["ontology_uid"] in root["ontologies"]
            _check_values(tag["tag_data"], {"text", "num", "boolean", "vec"})


def test_openlabel_comes_back_with_its_ego(tmp_path: Path) -> None:
    dataset = dataset_of("nuscenes_tiny", tmp_path)
    exporter = Exporter("openlabel", dataset, tmp_path / "out")
    for result in results(dataset):
        exporter.add(result)
    exporter.finish()
    ingest(tmp_path / "out", tmp_path / "again")
    before, after = next(dataset.labels()), next(open_dataset(tmp_path / "again").labels())
    assert after.has_ego
    assert (after.ego.x, after.ego.y) == pytest.approx((before.ego.x, before.ego.y))
    assert len(after.objects) == len(before.objects)


def test_openlabel_holds_what_is_known_and_counts_the_rest(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    (source / "dataset.json").write_text('{"interchange": 1, "angle": "yaw", "classes": "scenic", "ego": "none"}')
    line = {"id": "a", "recording": "r", "timestamp_us": 1, "map": "m", "ego": None, "params": {"rain": True, "t": 3}}
    whole = {"id": "o", "class": "Car", "position": [1, 2], "yaw": 0.5, "width": 2, "length": 4, "height": 1.5}
    line["objects"] = [
        {**whole, "attributes": {"colour": "red", "doors": 4, "parked": True}},
        {"id": "p", "class": "Pedestrian", "position": [3, 4], "yaw": None, "velocity": [1, 0]},
        {"id": "q", "class": "Bicycle", "position": [5, 6], "yaw": 0.25, "width": 0.6, "length": 1.8},
    ]
    line["sensors"] = {"CAM": "a.jpg"}
    (source / "labels.jsonl").write_text(json.dumps(line))
    ingest(source, tmp_path / "dataset", strict=False)
    dataset = open_dataset(tmp_path / "dataset")
    exporter = Exporter("openlabel", dataset, tmp_path / "out", "crossing")
    for _ in range(2):
        exporter.add(Result("a", "r", 1, Match({"ego": "o", "other": "p"}, {})))
    exporter.add(Result("b", "r", 2, Unknown("timeout", Cause("x"))))
    summary = exporter.finish()
    assert [each.message for each in summary.left_out] == [
        "2 objects have no box: a size or the heading is not known",
        "1 further matches of frames that are there already are left out",
        "1 frames that could not be decided are left out",
    ]
    (file,) = (tmp_path / "out").iterdir()
    content = json.loads(file.read_text())["openlabel"]
    frame = content["frames"]["0"]
    assert {key: each["name"] for key, each in content["objects"].items()} == {"0": "o", "1": "p", "2": "q"}
    car, person, bicycle = (frame["objects"][key]["object_data"] for key in "012")
    assert car["cuboid"][0]["val"] == pytest.approx([1, 2, 0, 0, 0, 0.5, 4, 2, 1.5])
    assert {"name": "colour", "val": "red"} in car["text"]
    assert {"name": "role", "val": "ego"} in car["text"]
    assert (car["num"], car["boolean"]) == ([{"name": "doors", "val": 4}], [{"name": "parked", "val": True}])
    assert "cuboid" not in person
    assert "num" not in person
    assert [each["name"] for each in person["vec"]] == ["position", "velocity"]
    assert {each["name"]: each["val"] for each in bicycle["num"]} == {"yaw": 0.25, "length": 1.8, "width": 0.6}
    assert frame["frame_properties"]["streams"] == {"CAM": {"uri": "a.jpg"}}
    assert content["tags"]["0"]["tag_data"]["boolean"] == [{"name": "rain", "val": True}]


@pytest.mark.parametrize(
    "name",
    ["x" * 300, "字" * 100, "\U0001f697" * 70, "ab" + "字" * 99, "/" * 400],
    ids=["long", "3 bytes", "4 bytes", "mixed", "odd"],
)
@pytest.mark.parametrize("kind", ["openlabel", "interchange", "paths"])
@pytest.mark.one_in(9)
def test_names_may_be_long(kind: str, name: str, tmp_path: Path) -> None:
    """The name of a file is no longer than systems take, whatever recordings and frames are called."""
    source = Path(shutil.copytree(SAMPLES / "crossroads", tmp_path / "source"))
    lines = [json.loads(line) for line in (source / "labels.jsonl").read_text().splitlines()]
    own = [
        line | {"recording": name, "id": f"{name}{line['id']}"}
        for line in lines
        if line["recording"] == lines[0]["recording"]
    ]
    (source / "labels.jsonl").write_text("".join(json.dumps(line) + "\n" for line in own))
    ingest(source, tmp_path / "d")
    export(kind, open_dataset(tmp_path / "d"), results(open_dataset(tmp_path / "d")), tmp_path / "out")
    files = [path for path in (tmp_path / "out").rglob("*") if path.is_file()]
    assert files
    assert max(len(path.name.encode()) for path in files) <= 255
    if kind == "interchange":
        ingest(tmp_path / "out", tmp_path / "again")
        assert {label.recording for label in open_dataset(tmp_path / "again").labels()} == {name}


def test_interchange_keeps_what_has_no_heading(tmp_path: Path) -> None:
    dataset = dataset_of("interaction_tiny", tmp_path)
    exporter = Exporter("interchange", dataset, tmp_path / "out")
    for result in results(dataset):
        exporter.add(result)
    assert exporter.finish().left_out == ()
    ingest(tmp_path / "out", tmp_path / "again", strict=True)
    labels = list(open_dataset(tmp_path / "again").labels())
    assert labels == list(dataset.labels())
    assert any(member.heading is None for label in labels for member in label.objects)


@pytest.mark.parametrize("kind", EXPORTS)
def test_no_match_is_an_empty_export(kind: str, tmp_path: Path) -> None:
    dataset = dataset_of("argoverse2_tiny" if kind == "argoverse2" else "nuscenes_tiny", tmp_path)
    label = next(iter(dataset.labels()))
    result = Result(label.frame, label.recording, label.timestamp_us, NoMatch(Cause("x"), {}))
    export(kind, dataset, [result], tmp_path / "out")


def test_what_cannot_be_exported(tmp_path: Path) -> None:
    dataset = dataset_of("nuscenes_tiny", tmp_path)

    def code(kind: str, target: Path) -> str:
        with pytest.raises(DataError) as error:
            Exporter(kind, dataset, target).finish()
        return error.value.diagnostics[0].code

    assert code("argoverse2", tmp_path / "out") == "option-invalid"
    assert code("csv", tmp_path / "out") == "option-invalid"
    assert code("paths", tmp_path / "dataset") == "target-exists"
    (tmp_path / "file").touch()
    assert code("paths", tmp_path / "file" / "out") == "target-unwritable"
    assert not (tmp_path / "out").exists()


def test_the_command_offers_the_forms_that_there_are():
    assert tuple(EXPORTS) == FORMS
