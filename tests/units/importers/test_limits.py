"""What a file may ask of an importer: bytes of a line, of a text, unpacked bytes, and places that are on earth."""

import gzip
import json
import shutil
import stat
import sys
from pathlib import Path

import pyarrow as pa
import pyarrow.feather
import pytest

from scenicq.errors import DataError
from scenicq.importers.columnar import read_feather
from scenicq.importers.fields import InvalidError, text
from scenicq.importers.grouped_lines import LineBounds, group_lines
from scenicq.importers.ingest import ingest
from scenicq.importers.opendrive import convert_xodr
from scenicq.importers.report import Report
from scenicq.store import unpacked
from scenicq.store.dataset import open_dataset

SOURCE = Path(__file__).parents[3] / "sample_data/crossroads"


@pytest.fixture
def source(tmp_path: Path) -> Path:
    return Path(shutil.copytree(SOURCE, tmp_path / "source"))


def _change(source: Path, change) -> None:
    file = source / "labels.jsonl"
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    change(lines)
    file.write_text("".join(json.dumps(line) + "\n" for line in lines))


def test_a_line_that_is_too_long_is_left_out_and_the_others_are_read(source):
    file = source / "labels.jsonl"
    whole = file.read_bytes().splitlines(keepends=True)
    assert max(map(len, whole)) < 1 << 14
    file.write_bytes(b"".join([whole[0], b"x" * 100_000 + b"\n", *whole[1:]]))
    report = Report()
    lines, _, count = group_lines([file], None, report, LineBounds(longest=1 << 14))
    assert count == len(whole)
    read = sorted(line + b"\n" for name in lines.runs for line, _ in lines.read(name))
    assert read == sorted(whole)
    assert "labels.jsonl:2: a line of 100,001 bytes is no label" in report.diagnostics[0].message


def test_nothing_but_empty_lines_is_no_source(source):
    (source / "labels.jsonl").write_bytes(b"\n" * 1002)
    with pytest.raises(DataError, match="more than 1,000 empty lines"):
        group_lines([source / "labels.jsonl"], None, Report(), LineBounds(empty=1000))


def test_a_packed_file_that_grows_beyond_all_measure_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(unpacked, "_LEAST", 1 << 20)
    bomb = tmp_path / "labels.jsonl.gz"
    with gzip.open(bomb, "wb") as file:
        file.write(b"x" * (8 << 20))
    with pytest.raises(DataError, match="unpacks to more than"):
        group_lines([bomb], tmp_path, Report())
    assert sum(path.stat().st_size for path in tmp_path.glob("*.jsonl")) < 4 << 20


def test_a_name_that_is_too_long_is_no_name():
    assert text({"id": "a" * 4096}, "id")
    with pytest.raises(InvalidError, match="longer than 4096 characters"):
        text({"id": "a" * 4097}, "id")


def test_a_table_with_texts_that_are_too_long_is_refused(tmp_path):
    pyarrow.feather.write_feather(pa.table({"name": ["a" * 5000]}), tmp_path / "t.feather")
    with pytest.raises(DataError, match="a text of more than 4096 characters"):
        read_feather(tmp_path / "t.feather", {"name": "text"}, count=lambda *_: None)


@pytest.mark.parametrize("far", [1e300, -1e8])
def test_an_object_at_no_place_on_a_map_is_left_out(source, tmp_path, far):
    def change(lines) -> None:
        lines[0]["objects"][0]["position"] = [far, 0.0]
        lines[1]["ego"]["position"] = [0.0, far]

    before = open_dataset_counts(SOURCE, tmp_path / "before")
    _change(source, change)
    summary = ingest(source, tmp_path / "made")
    told = [each.message for each in summary.diagnostics]
    assert sum("no place on a map" in each for each in told) == 2
    assert open_dataset(tmp_path / "made").manifest.total.frames == before - 1


def open_dataset_counts(source: Path, target: Path) -> int:
    ingest(source, target)
    return open_dataset(target).manifest.total.frames


def test_an_element_at_no_place_on_a_map_is_left_out(source, tmp_path):
    file = next((source / "maps").glob("*.geojson"))
    content = json.loads(file.read_text())
    ring = [[1e9, 0.0], [1e9 + 1, 0.0], [1e9 + 1, 1.0], [1e9, 0.0]]
    more = {"type": "Feature", "properties": {"id": "far", "kind": "lawn"},
            "geometry": {"type": "Polygon", "coordinates": [ring]}}  # fmt: skip
    content["features"].append(more)
    file.write_text(json.dumps(content))
    summary = ingest(source, tmp_path / "made")
    assert any("element `far` is at no place on a map" in each.message for each in summary.diagnostics)
    opened = open_dataset(tmp_path / "made")
    assert "far" not in {feature.id for feature in opened.features(opened.maps[0])}


@pytest.mark.skipif(sys.platform == "win32", reason="the stand-in for Python is a shell script")
def test_a_damaged_file_of_the_map_cache_is_made_again(tmp_path):
    stand_in = tmp_path / "python"
    stand_in.write_text(f'#!/bin/sh\necho run >> {tmp_path}/runs\necho made > "$4"\n')
    stand_in.chmod(stand_in.stat().st_mode | stat.S_IXUSR)
    (tmp_path / "town.xodr").write_text("<OpenDRIVE/>")

    def convert() -> Path:
        return convert_xodr(tmp_path / "town.xodr", tmp_path / "cache", python=str(stand_in))

    made = convert()
    assert convert() == made
    assert (tmp_path / "runs").read_text() == "run\n"
    made.write_text("made, and then half of it lo")
    assert convert().read_text() == "made\n"
    assert (tmp_path / "runs").read_text() == "run\nrun\n"


@pytest.mark.parametrize(
    ("table", "change"),
    [
        ("ego_pose", lambda row: row["translation"].__setitem__(1, 2**63)),
        ("ego_pose", lambda row: row["translation"].__setitem__(2, -1e8)),
        ("sample_annotation", lambda row: row["translation"].__setitem__(0, 5e151)),
    ],
)
def test_nothing_of_nuscenes_is_at_no_place_on_a_map(tmp_path, table, change):
    source = Path(shutil.copytree(SOURCE.with_name("nuscenes_tiny"), tmp_path / "source"))
    (file,) = source.rglob(f"{table}.json")
    rows = json.loads(file.read_text())
    for row in rows:
        change(row)
    rows[0]["translation"] = [1.0, 1.0, 1.0]
    file.write_text(json.dumps(rows))
    try:
        summary = ingest(source, tmp_path / "made")
        told = summary.diagnostics
        open_dataset(tmp_path / "made")
    except DataError as error:
        told = error.diagnostics
    assert any("no place on a map" in each.message for each in told)
    assert all(each.code != "dataset-invalid" for each in told)
