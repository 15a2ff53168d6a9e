"""Unsound sources: what is sound is kept, the rest is counted and told with its place; strict refuses."""

from __future__ import annotations

import gzip
import json
import os
import shutil
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scenicq.errors import DataError
from scenicq.importers.ingest import IngestSummary, Progress, ingest
from scenicq.store.dataset import open_dataset

SAMPLES = Path(__file__).parents[3] / "sample_data"


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """A copy of the town that a test may spoil."""
    return Path(shutil.copytree(SAMPLES / "crossroads", tmp_path / "source"))


@pytest.fixture
def tables(tmp_path: Path) -> Path:
    """A copy of the tiny nuScenes that a test may spoil."""
    return Path(shutil.copytree(SAMPLES / "nuscenes_tiny", tmp_path / "nuscenes"))


def edit_label(source: Path, number: int, change: Callable[[dict[str, Any]], object]) -> None:
    file = source / "labels.jsonl"
    lines = file.read_text().splitlines()
    label = json.loads(lines[number])
    change(label)
    lines[number] = json.dumps(label)
    file.write_text("\n".join(lines) + "\n")


def edit_rows(tables: Path, table: str, change: Callable[[list[dict[str, Any]]], object]) -> None:
    file = tables / "v1.0-tiny" / f"{table}.json"
    rows = json.loads(file.read_text())
    change(rows)
    file.write_text(json.dumps(rows, indent=0))


def refused(source: Path, target: Path, **options: Any) -> set[str]:
    """Codes of the error that an ingest ends with; nothing may remain of it."""
    before = set(target.parent.iterdir()) if target.parent.is_dir() else set()
    with pytest.raises(DataError) as error:
        ingest(source, target, **options)
    assert (set(target.parent.iterdir()) if target.parent.is_dir() else set()) == before
    return {diagnostic.code for diagnostic in error.value.diagnostics}


def left_out(summary: IngestSummary) -> dict[tuple[str, str], int]:
    return {(entry.what, entry.code): entry.count for entry in summary.left_out}


def place_of(**changes: Any) -> Callable[[dict[str, Any]], object]:
    return lambda label: label["objects"][0].update(changes)


@pytest.mark.parametrize(
    ("change", "what", "told"),
    [
        (place_of(position=[float("nan"), 0]), "object", "`position[0]` is not finite"),
        (place_of(position=[1, 2, 3]), "object", "`position` does not have 2 elements"),
        (place_of(position="here"), "object", "`position` is not a list but a text"),
        (place_of(heading=True), "object", "`heading` is not a number but a boolean"),
        (place_of(heading=1e999), "object", "`heading` is not finite"),
        (place_of(width=-1), "object", "`width` is not positive"),
        (place_of(velocity=[1]), "object", "`velocity` does not have 2 elements"),
        (place_of(id=7), "object", "`id` is not a text but a number"),
        (place_of(id="walker-1"), "object", "object id `walker-1` of label `01-quiet-street/01` is used twice"),
        (place_of(id="ego"), "object", "object id `ego` of label `01-quiet-street/01` is kept for the ego"),
        (place_of(attributes={"a": [1]}), "attribute", "`a` of `attributes` is a list"),
        (lambda label: label["objects"][0].pop("class"), "object", "`class` is missing"),
        (lambda label: label["objects"].insert(0, 3), "object", "it is not an object but a number"),
        (lambda label: label.pop("ego"), "label", "`ego` is missing"),
        (lambda label: label["ego"].pop("heading"), "label", "ego: `heading` is missing"),
        (lambda label: label.pop("objects"), "label", "`objects` is missing"),
        (lambda label: label.update(timestamp_us=1.5), "label", "`timestamp_us` is 1.5, which is not a whole number"),
        (lambda label: label.update(timestamp_us=10**30), "label", "`timestamp_us` is out of range"),
        (lambda label: label.update(id="01-quiet-street/00"), "label", "label id `01-quiet-street/00` is used twice"),
        (lambda label: label.update(timestamp_us=1700000000000000), "label", "has the time of label"),
        (lambda label: label.update(recording=5), "label", "`recording` is missing or is not a text"),
        (lambda label: label.update(map="other"), "label", "has map `other`, its recording began with `crossroads`"),
        (lambda label: label.update(sensors={"CAM": 1}), "label", "`CAM` is not a text but a number"),
    ],
)
@pytest.mark.one_in(12)
def test_an_unsound_record_is_left_out(
    source: Path, tmp_path: Path, change: Callable[[dict[str, Any]], object], what: str, told: str
) -> None:
    edit_label(source, 1, change)
    summary = ingest(source, tmp_path / "d")
    assert left_out(summary)[what, "record-invalid"] == 1
    messages = [diagnostic.message for diagnostic in summary.diagnostics if told in diagnostic.message]
    assert len(messages) == 1
    assert messages[0].startswith("labels.jsonl:2: ")
    assert summary.frames == (155 if what == "label" else 156)
    assert open_dataset(tmp_path / "d").manifest.left_out == summary.left_out
    assert refused(source, tmp_path / "e", strict=True) >= {"record-invalid"}


def test_a_label_that_is_cut_off(source: Path, tmp_path: Path) -> None:
    file = source / "labels.jsonl"
    file.write_bytes(file.read_bytes()[:-200])
    summary = ingest(source, tmp_path / "d")
    assert left_out(summary) == {("label", "file-invalid"): 1}
    assert summary.diagnostics[0].message.startswith("labels.jsonl:156: not JSON")
    assert summary.frames == 155
    assert refused(source, tmp_path / "e", strict=True) == {"file-invalid"}


def test_many_problems_are_all_counted_and_some_told(source: Path, tmp_path: Path) -> None:
    text = (source / "labels.jsonl").read_text()
    (source / "labels.jsonl").write_text(text.replace('"heading":', '"heding":', 10**6))
    assert refused(source, tmp_path / "d") == {"dataset-empty", "record-invalid"}
    (source / "labels.jsonl").write_text(text.replace('"class":"Car",', ""))
    summary = ingest(source, tmp_path / "d")
    count = left_out(summary)["object", "record-invalid"]
    assert count > 100
    assert len(summary.diagnostics) == 21
    assert summary.diagnostics[-1].message == f"{count} objects like this in all"


def test_unknown_class_is_kept_counted_and_mapped(source: Path, tmp_path: Path) -> None:
    edit_label(source, 1, place_of(**{"class": "spaceship"}))
    edit_label(source, 2, place_of(**{"class": "spaceship"}))
    summary = ingest(source, tmp_path / "d")
    found = [(entry.name, entry.count, entry.kept) for entry in summary.left_out if entry.code != "assumed"]
    assert found == [("spaceship", 2, True)]
    assert [diagnostic.code for diagnostic in summary.diagnostics] == ["unknown-class", "assumed"]
    assert summary.by_class["Object"] == 2
    member = next(iter(open_dataset(tmp_path / "d").labels(["01-quiet-street/01"]))).objects[0]
    assert (member.category, member.source_class) == ("Object", "spaceship")
    assert refused(source, tmp_path / "e", strict=True) == {"unknown-class"}
    (tmp_path / "map.json").write_text('{"spaceship": "Bus"}')
    mapped = ingest(source, tmp_path / "e", class_map=tmp_path / "map.json", strict=True)
    assert mapped.by_class["Bus"] == summary.by_class["Bus"] + 2


@pytest.mark.parametrize(
    ("content", "code"),
    [(None, "file-missing"), ("{", "file-invalid"), ("[1]", "file-invalid"), ('{"a": "UFO"}', "unknown-class")],
)
def test_unsound_class_map(source: Path, tmp_path: Path, content: str | None, code: str) -> None:
    file = source / "map.json"
    if content is not None:
        file.write_text(content)
    assert refused(source, tmp_path / "d", class_map=file) == {code}


def test_unknown_map_is_told_once_and_labels_are_kept(source: Path, tmp_path: Path) -> None:
    text = (source / "labels.jsonl").read_text()
    (source / "labels.jsonl").write_text(text.replace('"map":"crossroads"', '"map":"atlantis"'))
    summary = ingest(source, tmp_path / "d")
    assert left_out(summary) == {("label", "map-missing"): 156}
    assert len(summary.diagnostics) == 1
    dataset = open_dataset(tmp_path / "d")
    assert dataset.maps == ("atlantis", "crossroads")
    assert dataset.features("atlantis") == ()
    assert dataset.connect().sql("SELECT count(*) FROM memberships").fetchall() == [(0,)]
    assert refused(source, tmp_path / "e", strict=True) == {"map-missing"}
    map_file = source / "maps" / "crossroads.geojson"
    assert ingest(source, tmp_path / "e", maps=[f"atlantis={map_file}"], strict=True).frames == 156
    assert refused(source, tmp_path / "f", maps=["nowhere.geojson"]) == {"file-missing"}


def test_unsound_map_elements(source: Path, tmp_path: Path) -> None:
    file = source / "maps" / "crossroads.geojson"
    content = json.loads(file.read_text())
    lanes = [element for element in content["features"] if element["properties"]["kind"] == "lane"]
    lanes[0]["geometry"]["coordinates"] = [[[0, 0], [1, 1], [1, 0], [0, 1], [0, 0]]]
    lanes[1]["properties"]["left"] = "atlantis"
    file.write_text(json.dumps(content))
    summary = ingest(source, tmp_path / "d")
    counts = {(entry.code, entry.kept): entry.count for entry in summary.left_out}
    assert counts["map-invalid", False] == 1
    assert counts["map-invalid", True] >= 1
    assert any("atlantis" in diagnostic.message for diagnostic in summary.diagnostics)
    assert refused(source, tmp_path / "e", strict=True) == {"map-invalid"}
    file.write_text("{")
    assert refused(source, tmp_path / "e") == {"file-invalid"}


def test_a_coordinate_that_no_number_holds(source: Path, tmp_path: Path) -> None:
    file = source / "maps" / "crossroads.geojson"
    content = json.loads(file.read_text())
    content["features"][0]["geometry"]["coordinates"][0][1][0] = 10**400
    file.write_text(json.dumps(content))
    summary = ingest(source, tmp_path / "d")
    assert left_out(summary)["map element", "map-invalid"] >= 1
    assert any("its geometry cannot be read" in diagnostic.message for diagnostic in summary.diagnostics)


def test_empty_source(source: Path, tmp_path: Path) -> None:
    (source / "labels.jsonl").write_text("\n\n")
    assert refused(source, tmp_path / "d") == {"dataset-empty"}
    (source / "labels.jsonl").unlink()
    assert refused(source, tmp_path / "d") == {"file-missing"}


@pytest.mark.parametrize(
    "header",
    [
        {"interchange": 2},
        {"angle": "bearing"},
        {"classes": "klingon.json"},
        {"classes": 3},
        {"classes": "../../map.json"},
        {"classes": "/etc/passwd"},
        {"classes": "link.json"},
    ],
)
def test_unsound_header_and_paths_that_leave_the_folder(source: Path, tmp_path: Path, header: dict[str, Any]) -> None:
    (tmp_path / "map.json").write_text('{"Car": "Car"}')
    (source / "link.json").symlink_to(tmp_path / "map.json")
    file = source / "dataset.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | header))
    expected = {"file-missing"} if header == {"classes": "klingon.json"} else {"file-invalid"}
    assert refused(source, tmp_path / "d") == expected


def test_class_map_inside_of_the_folder(source: Path, tmp_path: Path) -> None:
    (source / "classes.json").write_text('{"Car": "Truck", "Truck": "Truck"}')
    file = source / "dataset.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"classes": "classes.json"}))
    assert ingest(source, tmp_path / "d").by_class["Truck"] > 100


def test_yaw_is_turned_into_heading(source: Path, tmp_path: Path) -> None:
    ingest(source, tmp_path / "heading")
    file = source / "dataset.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"angle": "yaw"}))
    labels = source / "labels.jsonl"
    labels.write_text(labels.read_text().replace('"heading":', '"yaw":'))
    ingest(source, tmp_path / "yaw")
    first, second = (next(open_dataset(tmp_path / name).labels()).ego.heading for name in ("heading", "yaw"))
    assert first == 0.0
    assert second == pytest.approx(-1.5707963267948966)


@pytest.mark.parametrize("form", ["split", "shuffled", "gzip", "parquet"])
@pytest.mark.one_in(2)
def test_spellings_of_the_labels_give_the_same_dataset(source: Path, tmp_path: Path, form: str) -> None:
    ingest(source, tmp_path / "plain")
    file = source / "labels.jsonl"
    lines = file.read_bytes().splitlines(keepends=True)
    file.unlink()
    if form == "split":
        (source / "labels-1.jsonl").write_bytes(b"".join(lines[::2]))
        (source / "labels-2.jsonl.gz").write_bytes(gzip.compress(b"".join(lines[1::2])))
    elif form == "shuffled":
        file.write_bytes(b"".join(sorted(lines, key=lambda line: hash(line[60:]) % 1000)))
    elif form == "gzip":
        (source / "labels.jsonl.gz").write_bytes(gzip.compress(b"".join(lines)))
    else:
        pq.write_table(pa.Table.from_pylist([json.loads(line) for line in lines]), source / "labels.parquet")
    summary = ingest(source, tmp_path / "d")
    assert summary.left_out == ()
    assert list(open_dataset(tmp_path / "d").labels()) == list(open_dataset(tmp_path / "plain").labels())


@pytest.mark.parametrize("name", ["labels.jsonl.gz", "labels.parquet"])
def test_packed_labels_that_are_cut_off(source: Path, tmp_path: Path, name: str) -> None:
    (source / name).write_bytes(gzip.compress((source / "labels.jsonl").read_bytes())[:500])
    (source / "labels.jsonl").unlink()
    assert refused(source, tmp_path / "d") == {"file-invalid"}


def test_targets(source: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder").mkdir()
    assert refused(source, tmp_path / "file", force=True) == {"target-exists"}
    assert refused(source, tmp_path / "folder", force=True) == {"target-exists"}
    assert refused(source, source, force=True) == {"target-exists"}
    assert refused(source, tmp_path / "file" / "d") == {"target-unwritable"}
    assert refused(source, tmp_path / "nowhere" / "d") == {"target-unwritable"}
    ingest(source, tmp_path / "d")
    assert refused(source, tmp_path / "d") == {"target-exists"}
    ingest(source, tmp_path / "d", force=True)


def test_sources_that_nobody_or_everybody_recognises(source: Path, tables: Path, tmp_path: Path) -> None:
    assert refused(tmp_path / "nowhere", tmp_path / "d") == {"file-missing"}
    (tmp_path / "empty").mkdir()
    assert refused(tmp_path / "empty", tmp_path / "d") == {"dataset-unrecognised"}
    assert refused(source, tmp_path / "d", format="klingon") == {"option-invalid"}
    ingest(source, tmp_path / "dataset")
    assert refused(tmp_path / "dataset", tmp_path / "d") == {"dataset-unrecognised"}
    shutil.copytree(tables / "v1.0-tiny", source / "v1.0-tiny")
    with pytest.raises(DataError, match="recognised by `interchange` and `nuscenes`"):
        ingest(source, tmp_path / "d")
    assert ingest(source, tmp_path / "d", format="nuscenes").frames == 6


def test_missing_and_broken_tables(tables: Path, tmp_path: Path) -> None:
    folder = tables / "v1.0-tiny"
    whole = (folder / "sample_annotation.json").read_bytes()
    (folder / "sample_annotation.json").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(DataError, match=r"sample_annotation\.json:\d+ is cut off or is not JSON here"):
        ingest(tables, tmp_path / "d")
    (folder / "sample_annotation.json").write_text('{"a": 1}')
    assert refused(tables, tmp_path / "d") == {"file-invalid"}
    (folder / "sample_annotation.json").unlink()
    assert refused(tables, tmp_path / "d") == {"file-missing"}
    shutil.copytree(folder, tables / "v1.0-other")
    assert refused(tables, tmp_path / "d") == {"dataset-unrecognised"}
    assert refused(tables, tmp_path / "d", format="nuscenes") == {"dataset-ambiguous"}
    assert not (tmp_path / "d").exists()


@pytest.mark.parametrize(
    ("table", "changes", "what", "frames", "objects"),
    [
        ("sample_annotation", {"translation": [float("nan"), 0, 0]}, "object", 6, 11),
        ("sample_annotation", {"rotation": [0, 0, 0, 0]}, "object", 6, 11),
        ("sample_annotation", {"size": [1, 0, 1]}, "object", 6, 11),
        ("sample_annotation", {"instance_token": "atlantis"}, "object", 6, 11),
        ("sample_annotation", {"attribute_tokens": ["atlantis"]}, "object", 6, 11),
        ("sample_annotation", {"attribute_tokens": 3}, "object", 6, 11),
        ("ego_pose", {"translation": [float("inf"), 0, 0]}, "label", 5, 10),
        ("sample", {"timestamp": "noon"}, "label", 5, 10),
        ("scene", {"log_token": "atlantis"}, "recording", 3, 6),
        ("instance", {"category_token": "atlantis"}, "object", 6, 9),
    ],
)
def test_unsound_rows(
    tables: Path, tmp_path: Path, table: str, changes: dict[str, Any], what: str, frames: int, objects: int
) -> None:
    edit_rows(tables, table, lambda rows: rows[0].update(changes))
    summary = ingest(tables, tmp_path / "d")
    assert (summary.frames, summary.objects) == (frames, objects)
    assert (what, "record-invalid") in left_out(summary)
    assert summary.diagnostics[0].message.startswith(f"{table}.json:2: ")
    assert refused(tables, tmp_path / "e", strict=True) == {"record-invalid"}


def test_empty_tokens_and_lone_annotations(tables: Path, tmp_path: Path) -> None:
    def thin(rows: list[dict[str, Any]]) -> None:
        rows[0].update(visibility_token="", attribute_tokens=[])
        del rows[2:]

    edit_rows(tables, "sample_annotation", thin)
    summary = ingest(tables, tmp_path / "d", strict=True)
    assert summary.objects == 2
    label = next(open_dataset(tmp_path / "d").labels())
    assert [member.velocity for member in label.objects] == [None, None]
    assert label.objects[0].attributes == {"num_lidar_pts": 10, "num_radar_pts": 0}


def test_interrupt_through_progress(source: Path, tmp_path: Path) -> None:
    def interrupt(progress: Progress) -> None:
        if progress.frames > 50:
            raise KeyboardInterrupt

    for jobs in (1, 2):
        with pytest.raises(KeyboardInterrupt):
            ingest(source, tmp_path / "d", progress=interrupt, jobs=jobs)
        assert [path.name for path in tmp_path.iterdir()] == ["source"]


def test_progress_counts_up(source: Path, tmp_path: Path) -> None:
    seen: list[Progress] = []
    ingest(source, tmp_path / "d", progress=seen.append)
    assert [progress.frames for progress in seen] == [26, 52, 78, 104, 130, 156]
    assert {progress.total for progress in seen} == {156}


def _heed_interrupts() -> None:
    """A job in the background of a shell ignores interrupts, and so would what it starts."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_in_the_middle(source: Path, tmp_path: Path, number: signal.Signals) -> None:
    program = textwrap.dedent("""
        import sys, time
        from scenicq.importers.ingest import ingest
        def wait(progress):
            print("writing", flush=True)
            time.sleep(30)
        ingest(sys.argv[1], sys.argv[2], progress=wait)
    """)
    arguments = [sys.executable, "-c", program, str(source), str(tmp_path / "d")]
    environment = os.environ | {"PYTHONPATH": str(SAMPLES.parent)}
    with subprocess.Popen(
        arguments,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
        preexec_fn=_heed_interrupts,  # noqa: PLW1509
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"writing\n"
        assert len(list(tmp_path.iterdir())) == 2
        process.send_signal(number)
        assert process.wait() != 0
    assert [path.name for path in tmp_path.iterdir()] == ["source"]


def test_elements_of_maps_that_no_file_can_hold_are_left_out(source: Path, tmp_path: Path) -> None:
    file = next((source / "maps").glob("*.geojson"))
    collection = json.loads(file.read_text())
    whole = len(collection["features"])
    collection["features"][0]["properties"]["id"] = "half \ud800"
    collection["features"][1]["properties"]["more"] = {"deep": ["\udc00"]}
    collection["features"][2]["properties"]["\ud811"] = 1
    file.write_text(json.dumps(collection))
    summary = ingest(source, tmp_path / "dataset")
    told = [each.message for each in summary.diagnostics if "half of a character" in each.message]
    assert len(told) == 3
    assert "element 'half \\ud800'" in told[0]
    dataset = open_dataset(tmp_path / "dataset")
    assert len(dataset.features(dataset.maps[0])) == whole - 3
