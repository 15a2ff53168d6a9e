"""Datasets elsewhere: the same labels and results, from the few bytes that are needed, and nothing but the dataset."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import duckdb
import pytest

from scenicq.errors import DataError
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.records import record
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store import remote
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.manifest import MANIFEST, read_manifest
from scenicq.store.writer import write_dataset

fsspec = pytest.importorskip("fsspec", reason="scenicq[s3] is not installed")

ROOT = Path(__file__).parents[3]
PROGRAM = ROOT / "sample_data" / "scenarios" / "01_pedestrian_facing_ego.scenic"
OPTIONS = QueryOptions(MatchOptions(tolerance=parse_tolerance("x=0.25,y=0.25,heading=5deg"), classes="coarse"))


@pytest.fixture
def memory(crossroads: Path) -> Iterator[str]:
    """The sample dataset in the memory of this process."""
    files = fsspec.filesystem("memory")
    files.put(str(crossroads), "/town", recursive=True)
    yield "memory://town"
    files.rm("/town", recursive=True)


class Fetched:
    """Counts what is asked for."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.requests = self.bytes = 0
        real = remote.RemoteFolder.fetch

        def fetch(folder: remote.RemoteFolder, part: Any, start: int, end: int) -> bytes:
            self.requests += 1
            self.bytes += end - start
            return real(folder, part, start, end)

        patch.setattr(remote.RemoteFolder, "fetch", fetch)


def records(dataset: Dataset) -> list[dict[str, Any]]:
    return [record(result) for result in Query(dataset, read_program(PROGRAM), OPTIONS).results()]


def test_everything_is_what_it_is_here(memory: str, crossroads: Path) -> None:
    there, here = open_dataset(memory), open_dataset(crossroads)
    assert there.name == there.address == memory
    assert list(there.labels()) == list(here.labels())
    assert list(there.labels(["03-busy-intersection/09"])) == list(here.labels(["03-busy-intersection/09"]))
    assert there.features("crossroads") == here.features("crossroads")
    assert records(there) == records(here) != []
    there.verify()


def test_a_file_address_is_a_path(crossroads: Path) -> None:
    dataset = open_dataset(crossroads.as_uri())
    assert dataset.path == crossroads
    assert dataset.files("labels")[0].parent.parent == crossroads


def test_only_what_is_needed_is_fetched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def label(recording: str, number: int) -> Label:
        others = tuple(
            LabelObject(
                str(n), "Car", "car", n + number / 7, n * number / 11, 0.5, attributes={"text": f"{n}-{number}"}
            )
            for n in range(60)
        )
        ego = LabelObject("ego", "Car", "car", 0.0, 0.0, 0.0)
        return Label(f"{recording}/{number:04}", recording, number, "town", ego, others)

    labels = [Recording(name, "town", tuple(label(name, n) for n in range(500))) for name in ("a", "b")]
    write_dataset(tmp_path / "d", labels, {}, name="many", segment_objects=1)
    files = fsspec.filesystem("memory")
    files.put(str(tmp_path / "d"), "/many", recursive=True)
    monkeypatch.setattr(remote, "_TAIL", 1 << 14)
    size = sum(path.stat().st_size for path in (tmp_path / "d").rglob("*.parquet"))
    dataset, fetched = open_dataset("memory://many"), Fetched(monkeypatch)
    assert [found.frame for found in dataset.labels(["b/0007"])] == ["b/0007"]
    assert 0 < fetched.bytes < size / 3
    fetched.bytes = fetched.requests = 0
    (count,) = dataset.connect().execute("SELECT count(*) FROM objects WHERE class = 'Car'").fetchall()
    assert count == (60_000,)
    assert fetched.bytes < size / 20
    assert fetched.requests < 40
    files.rm("/many", recursive=True)


def test_a_connection_reads_nothing_else(memory: str) -> None:
    connection = open_dataset(memory).connect()
    for other in ("scenicq://dataset.json", "memory://town/dataset.json", "/etc/passwd", f"{ROOT}/README.md"):
        with pytest.raises(duckdb.Error):
            connection.sql(f"SELECT * FROM read_text('{other}')").fetchall()
    connection.close()


@pytest.mark.parametrize(
    "path",
    [
        "../other/objects/part-00000.parquet",
        "/etc/passwd",
        "objects/../../x.parquet",
        "s3://elsewhere/x.parquet",
        "objects/*.parquet",
        "objects/.hidden.parquet",
        "objects\\x.parquet",
        "objects/x.parquet\n",
    ],
)
def test_a_manifest_that_leads_elsewhere_is_refused(crossroads: Path, path: str) -> None:
    content = json.loads((crossroads / MANIFEST).read_text())
    content["tables"]["objects"][0]["path"] = path
    with pytest.raises(DataError, match="unsound") as error:
        read_manifest("d", json.dumps(content).encode())
    assert error.value.diagnostics[0].code == "store-damaged"


def test_a_file_that_changed_is_named(memory: str) -> None:
    files = fsspec.filesystem("memory")
    dataset = open_dataset(memory)
    path = f"/town/{dataset.manifest.tables['objects'][0].path}"
    content = bytearray(files.cat_file(path))
    content[len(content) // 2] ^= 1
    files.pipe_file(path, bytes(content))
    with pytest.raises(DataError, match=r"objects/part-00000.* has changed"):
        dataset.verify()
    files.pipe_file(path, bytes(content[:-1]))
    with pytest.raises(DataError, match=r"objects/part-00000.* has changed"):
        dataset.verify()
    files.rm(path)
    for read in (dataset.verify, lambda: list(open_dataset(memory).labels())):
        with pytest.raises(DataError, match="objects/part-00000"):
            read()


@pytest.mark.parametrize(
    ("address", "words"),
    [("memory://nowhere", "has no dataset.json"), ("laserdisc://a/b", "laserdisc"), ("s3://", "s3://")],
)
def test_what_is_not_there(bucket: Any, address: str, words: str) -> None:
    with pytest.raises(DataError, match=words) as error:
        open_dataset(address)
    assert len(error.value.diagnostics) == 1


def test_without_the_extra_it_is_said_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(remote, "find_spec", lambda _: None)
    with pytest.raises(DataError, match=r"pip install 'scenicq\[s3\]'"):
        open_dataset("s3://fleet/town")


def test_on_s3(bucket: Any, crossroads: Path, run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    bucket.put(str(crossroads), "fleet/town", recursive=True)
    here, there = str(crossroads), "s3://fleet/town"
    frame = "03-busy-intersection/09"
    for command in (
        ["match", PROGRAM, "DATASET", "--tolerance", "heading=5deg,position=0.3", "--classes", "coarse"],
        ["explain", PROGRAM, "DATASET", frame, "--exit-zero"],
        ["show", "DATASET", frame, "--scenario", PROGRAM],
        ["match", PROGRAM, "DATASET", "--explain"],
    ):
        local, distant = (run(*(place if word == "DATASET" else word for word in command)) for place in (here, there))
        assert distant.exit_code == local.exit_code == 0, distant.output
        assert distant.stdout == local.stdout.replace(str(crossroads / "objects"), "scenicq://objects")
    told = run("info", there, "--verify")
    assert told.exit_code == 0, told.output
    assert "156 frames" in told.stdout
    assert "every checksum is right" in told.stdout
    refused = run("index", there)
    assert refused.exit_code == 2
    assert refused.stderr.startswith("error[option-invalid]: s3://fleet/town can only be read")


@pytest.mark.slow
def test_two_processes_read_from_s3(bucket: Any, crossroads: Path) -> None:
    bucket.put(str(crossroads), "fleet/again", recursive=True)
    there = Query(open_dataset("s3://fleet/again"), read_program(PROGRAM), replace(OPTIONS, jobs=2))
    assert [record(result) for result in there.results()] == records(open_dataset(crossroads))
