"""Sources that once crashed an ingest, found by `fuzzing/fuzz.py`: each ends with a dataset or with a diagnostic."""

from __future__ import annotations

import gzip
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pyarrow import feather

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest
from scenicq.store.dataset import open_dataset

SAMPLES = Path(__file__).parents[3] / "sample_data"
LOG = "val/5ce0c0de-0000-4000-8000-000000000001"
FORECAST = "val/5ce0c0de-0000-4000-8000-000000000002/scenario_5ce0c0de-0000-4000-8000-000000000002.parquet"
TRACKS = "recorded_trackfiles/TINY_Street/vehicle_tracks_000.csv"


def twice(file: Path, column: str) -> None:
    read, write = (feather.read_table, feather.write_feather) if file.suffix == ".feather" else (
        pq.read_table, pq.write_table)  # fmt: skip
    table = read(file)
    write(table.append_column(column, table[column]), file)


def edit_json(file: Path, change: Callable[[object], object]) -> None:
    content = json.loads(file.read_text())
    change(content)
    file.write_text(json.dumps(content))


def open_ring(town: dict) -> None:
    """A ring that begins with what is not equal to itself can never be closed."""
    feature = next(each for each in town["features"] if each["geometry"]["type"] == "Polygon")
    ring = feature["geometry"]["coordinates"][0]
    ring[0] = ring[-1] = [float("nan"), 0.0]


def long_lane(town: dict) -> None:
    path = next(iter(town["arcline_path_3"].values()))
    path[0]["segment_length"][1] = 1e150


def torn_text(root: Path) -> None:
    """A Parquet file whose text is no longer UTF-8."""
    lines = (root / "labels.jsonl").read_text().splitlines()[:5]
    table = pa.Table.from_pylist([json.loads(line) for line in lines])
    pq.write_table(table, root / "labels.parquet", compression="none", use_dictionary=False)
    content = (root / "labels.parquet").read_bytes()
    (root / "labels.parquet").write_bytes(content.replace(b"01-quiet-street", b"01-quiet-\xe5tree\xf8", 40))
    (root / "labels.jsonl").unlink()


def torn_gzip(root: Path) -> None:
    packed = bytearray(gzip.compress((root / "labels.jsonl").read_bytes()))
    packed[len(packed) // 2 : len(packed) // 2 + 8] = b"\xff" * 8
    (root / "labels.jsonl.gz").write_bytes(packed)
    (root / "labels.jsonl").unlink()


def rename(root: Path, old: str, new: bytes) -> None:
    file = root / old
    file.rename(os.fsdecode(os.fsencode(file.parent) + b"/" + new))


EDITS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "a column of boxes twice": ("argoverse2_tiny", lambda root: twice(root / LOG / "annotations.feather", "tx_m")),
    "a column of tracks twice": ("forecasting_tiny", lambda root: twice(root / FORECAST, "object_type")),
    "a class file with a null byte": (
        "crossroads", lambda root: edit_json(root / "dataset.json", lambda header: header.update(classes="a\0b"))),
    "a ring that is not closed": ("crossroads", lambda root: edit_json(root / "maps/crossroads.geojson", open_ring)),
    "a sample token that is an object": (
        "nuscenes_tiny",
        lambda root: edit_json(
            root / "v1.0-tiny/sample_data.json", lambda rows: rows[0].update(sample_token={"x": []}))),
    "a lane of 1e150 m": (
        "nuscenes_tiny", lambda root: edit_json(root / "maps/expansion/tiny-town.json", long_lane)),
    "text that is none in Parquet": ("crossroads", torn_text),
    "gzip with changed bytes": ("crossroads", torn_gzip),
    "a map's name that is no text": (
        "crossroads", lambda root: rename(root, "maps/crossroads.geojson", b"\xff\n.geojson")),
    "a sequence's name that is no text": (
        "commonroad_tiny", lambda root: rename(root, "ZAM_Tiny-1_1_T-1_2018b.xml", b"\xff\n.xml")),
    "a recording's name that is no text": ("openlabel_tiny", lambda root: rename(root, "tiny.json", b"\xff.json")),
}  # fmt: skip


def ends_well(root: Path, target: Path, **options: str) -> str:
    """What is told; a dataset that is made can be read."""
    try:
        summary = ingest(root, target, **options)  # type: ignore[arg-type]
    except DataError as error:
        assert not target.exists()
        return str(error)
    dataset = open_dataset(target)
    assert len(list(dataset.labels())) == summary.frames
    assert all(dataset.network(name).name == name for name in dataset.maps)
    return " ".join(diagnostic.message for diagnostic in summary.diagnostics)


@pytest.mark.parametrize("name", EDITS)
def test_a_source_that_crashed(tmp_path: Path, name: str) -> None:
    sample, edit = EDITS[name]
    root = Path(shutil.copytree(SAMPLES / sample, tmp_path / "source"))
    edit(root)
    ends_well(root, tmp_path / "d")


@pytest.mark.timeout(60)
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
@pytest.mark.parametrize(
    ("sample", "file"),
    [
        ("crossroads", "dataset.json"),
        ("crossroads", "labels.jsonl"),
        ("crossroads", "maps/crossroads.geojson"),
        ("interaction_tiny", TRACKS),
        ("argoverse2_tiny", f"{LOG}/map/log_map_archive_{LOG[4:]}____TNY_city_1.json"),
        ("forecasting_tiny", FORECAST),
        ("kitti_tiny", "training/oxts/0000.txt"),
        ("nuscenes_tiny", "v1.0-tiny/log.json"),
    ],
)
def test_a_pipe_is_no_file(tmp_path: Path, sample: str, file: str) -> None:
    root = Path(shutil.copytree(SAMPLES / sample, tmp_path / "source"))
    (root / file).unlink()
    os.mkfifo(root / file)
    assert ends_well(root, tmp_path / "d")


def test_a_command_line_that_is_no_text(tmp_path: Path) -> None:
    ends_well(SAMPLES / "commonroad_tiny", tmp_path / "d", ego="\udcff")
    town = SAMPLES / "crossroads" / "maps" / "crossroads.geojson"
    ingest(SAMPLES / "crossroads", tmp_path / "e", maps=[f"\udcff={town}"])
    assert open_dataset(tmp_path / "e").maps == ("\\udcff", "crossroads")
