"""Small files that unpack to a lot are refused before they do; what they would take is counted without taking it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pyarrow import feather

from scenicq.errors import DataError
from scenicq.importers.columnar import read_feather, read_parquet
from scenicq.importers.ingest import ingest
from scenicq.importers.prediction_files import read_predictions
from scenicq.query.execution.result_files import read_records
from scenicq.store import unpacked
from scenicq.store.unpacked import decoded_bytes

SAMPLES = Path(__file__).parents[3] / "sample_data"
LEAST = 1 << 20
"""Bytes that are always allowed, here."""
ROWS = 3000
TEXT = "x" * 4000


@pytest.fixture(autouse=True)
def little(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unpacked, "_LEAST", LEAST)


def dictionary(text: str = TEXT, rows: int = ROWS) -> Any:
    return pa.DictionaryArray.from_arrays(pa.array([0] * rows, pa.int32()), pa.array([text]))


ARRAYS: dict[str, Callable[[], Any]] = {
    "texts of a dictionary": dictionary,
    "texts": lambda: pa.array([TEXT] * ROWS),
    "numbers": lambda: pa.array([1.0] * 100_000),
    "nothing": lambda: pa.nulls(100_000),
    "lists": lambda: pa.array([[0] * 1000] * 100),
    "lists of texts": lambda: pa.ListArray.from_arrays(pa.array(range(0, ROWS + 1, 10), pa.int32()), dictionary()),
    "structs": lambda: pa.StructArray.from_arrays([dictionary()], ["a"]),
    "maps": lambda: pa.array([[("k" * 1000, TEXT)]] * ROWS, pa.map_(pa.string(), pa.string())),
}


@pytest.mark.parametrize("name", ARRAYS)
def test_what_is_counted_is_at_least_what_python_takes(name: str) -> None:
    array = ARRAYS[name]()
    assert decoded_bytes(array) >= len(json.dumps(array.to_pylist()))
    assert decoded_bytes(array.slice(1, 10)) < decoded_bytes(array) / 5


def test_views_are_counted_where_they_lead() -> None:
    if not hasattr(pa, "string_view"):
        pytest.skip("this pyarrow has no views")
    array = pa.array([TEXT] * ROWS).cast(pa.string_view())
    assert decoded_bytes(array) >= ROWS * len(TEXT)


def write(path: Path, table: Any, compression: str = "zstd") -> Path:
    if path.suffix == ".parquet":
        pq.write_table(table, path, compression=compression)
    else:
        feather.write_feather(table, path, compression=compression)
    assert path.stat().st_size * 200 < LEAST * 8
    return path


@pytest.mark.parametrize("name", ["texts of a dictionary", "texts", "numbers"])
@pytest.mark.parametrize("suffix", [".parquet", ".feather"])
def test_columns_that_unpack_to_too_much_are_refused(tmp_path: Path, suffix: str, name: str) -> None:
    path = write(tmp_path / f"t{suffix}", pa.table({"a": ARRAYS[name]()}))
    read = read_parquet if suffix == ".parquet" else read_feather
    before = pa.total_allocated_bytes()
    with pytest.raises(DataError, match="unpacks to more than"):
        read(path, {"a": "real" if name == "numbers" else "text"}, count=lambda *_: None)
    assert pa.total_allocated_bytes() - before < 4 * LEAST


def test_buffers_of_feather_are_not_unpacked_to_be_counted(tmp_path: Path) -> None:
    path = write(tmp_path / "t.feather", pa.table({"a": [0.0] * 10_000_000}))
    bound = unpacked.Bound(path)
    before = pa.total_allocated_bytes()
    with pytest.raises(DataError, match="unpacks to more than"):
        unpacked.feather_batches(path.read_bytes(), bound)
    assert pa.total_allocated_bytes() - before < 4 * LEAST


@pytest.mark.parametrize("compression", ["uncompressed", "lz4", "zstd"])
def test_feather_files_are_read_as_pyarrow_reads_them(tmp_path: Path, compression: str) -> None:
    table = pa.table({"a": [1, None, 3], "b": ["x", "y", None], "c": dictionary("z", 3), "d": [[1.5], [], None]})
    feather.write_feather(table, tmp_path / "t.feather", compression=compression, chunksize=2)
    data = (tmp_path / "t.feather").read_bytes()
    schema, batches = unpacked.feather_batches(data, unpacked.Bound(tmp_path / "t.feather"))
    assert pa.Table.from_batches(batches, schema).to_pylist() == table.to_pylist()
    for end in range(8, len(data), 7):
        with pytest.raises((pa.ArrowException, OSError, ValueError)):
            unpacked.feather_batches(data[:end], unpacked.Bound(tmp_path / "t.feather"))


@pytest.mark.parametrize("where", ["id", "class", "attributes"])
def test_labels_in_parquet(tmp_path: Path, where: str) -> None:
    source = Path(shutil.copytree(SAMPLES / "crossroads", tmp_path / "source"))
    (source / "labels.jsonl").unlink()
    member = {"id": "o", "class": "Car", "position": [0.0, 0.0], "heading": 0.0, "attributes": {"a": "b"}}
    label = {"id": "f", "recording": "r", "timestamp_us": 0, "map": "crossroads", "ego": member, "objects": [member]}
    if where == "id":
        label["id"] = TEXT
    elif where == "class":
        member["class"] = TEXT
    else:
        member["attributes"] = {"a": TEXT}
    write(source / "labels.parquet", pa.Table.from_pylist([label] * ROWS))
    with pytest.raises(DataError, match="unpacks to more than"):
        ingest(source, tmp_path / "made")
    assert not (tmp_path / "made").exists()


def test_results_and_predictions(tmp_path: Path) -> None:
    results = write(tmp_path / "r.parquet", pa.table({"frame": [TEXT] * ROWS, "recording": ["r"] * ROWS}))
    with pytest.raises(DataError, match="unpacks to more than"):
        list(read_records(results))
    for suffix in (".parquet", ".feather"):
        predictions = write(tmp_path / f"p{suffix}", pa.table({"frame": [TEXT] * ROWS, "class": ["Car"] * ROWS}))
        with pytest.raises(DataError, match="unpacks to more than"):
            read_predictions(predictions)


GIANT = 300_000
"""Rows that pack to a few bytes each, and to less than 256 MiB as bare values."""


def sensor_log(folder: Path, rows: int) -> list[object]:
    """An Argoverse 2 log of one frame."""
    time, turn = 315_966_253_660_357_000, {"qw": 1.0, "qx": 0.0, "qy": 0.0, "qz": 0.0}
    pose = {"timestamp_ns": time, **turn, "tx_m": 1.0, "ty_m": 1.0, "tz_m": 0.0}
    box = {**pose, "category": "REGULAR_VEHICLE", "length_m": 4.0, "width_m": 2.0, "height_m": 1.5}
    (folder / "log").mkdir(parents=True)
    columns = {name: pa.repeat(value, rows) for name, value in box.items()}
    columns["track_uuid"] = pa.array([f"{number:036}" for number in range(rows)])
    feather.write_feather(pa.table(columns), folder / "log/annotations.feather", compression="zstd")
    feather.write_feather(pa.Table.from_pylist([pose]), folder / "log/city_SE3_egovehicle.feather")
    return ["ingest", folder]


def forecasting(folder: Path, rows: int) -> list[object]:
    """An Argoverse 2 forecasting scenario of one step."""
    (folder / "s").mkdir(parents=True)
    reals = dict.fromkeys(("position_x", "position_y", "heading", "velocity_x", "velocity_y"), 1.0)
    row = {"object_type": "vehicle", "timestep": 0, "city": "x", **reals}
    columns = {name: pa.repeat(value, rows) for name, value in row.items()}
    columns["track_id"] = pa.array(["AV", *map(str, range(1, rows))])
    pq.write_table(pa.table(columns), folder / "s/scenario_s.parquet", compression="zstd")
    return ["ingest", folder]


def packed_labels(folder: Path, rows: int) -> list[object]:
    """An interchange folder of one label."""
    folder.mkdir()
    header = {"name": "x", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (folder / "dataset.json").write_text(json.dumps(header))
    member = {"class": "Car", "position": [1.0, 2.0], "heading": 0.0, "width": 2.0, "length": 4.0}
    label = {"id": "f", "recording": "r", "timestamp_us": 0, "map": "m", "ego": member}
    label["objects"] = [{**member, "id": f"o{number}"} for number in range(rows)]
    pq.write_table(pa.Table.from_pylist([label]), folder / "labels.parquet", compression="zstd")
    return ["ingest", folder]


def results(folder: Path, rows: int) -> list[object]:
    """A file of results."""
    folder.mkdir()
    row = dict.fromkeys(("frame", "recording", "correspondence", "witness", "cause", "sensors"), "{}")
    columns = {name: pa.repeat(value, rows) for name, value in {**row, "timestamp_us": 0, "verdict": "match"}.items()}
    pq.write_table(pa.table(columns), folder / "r.parquet", compression="zstd")
    return ["report", folder / "r.parquet"]


@pytest.mark.skipif(sys.platform != "linux", reason="memory is counted as Linux does")
@pytest.mark.parametrize("rows", [GIANT, pytest.param(100_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("source", [sensor_log, forecasting, packed_labels, results])
@pytest.mark.one_in(8)
def test_what_a_file_takes_is_bounded_whatever_its_rows_become(
    source: Callable[[Path, int], list[object]], rows: int, command: str, tmp_path: Path
) -> None:
    words = source(tmp_path / "source", rows)
    size = max(path.stat().st_size for path in (tmp_path / "source").rglob("*") if path.is_file())
    most = max(1 << 28, 200 * size)
    target = tmp_path / ("made" if words[0] == "ingest" else "source/r.parquet")
    alone = peak_bytes(command, "ingest", SAMPLES / "crossroads", tmp_path / "small")
    assert peak_bytes(command, *words, target) < alone + most
    assert most < 1600 * GIANT


def peak_bytes(*words: object) -> int:
    """What a command has had in memory at most."""
    running = subprocess.Popen([*map(str, words)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, _, used = os.wait4(running.pid, 0)
    running.returncode = 0
    return used.ru_maxrss * 1024
