"""`scenicq evaluate`: every format, and what it refuses."""

from __future__ import annotations

import csv
import io
import json

import pyarrow.parquet as pq
import pytest

from scenicq.evaluate.rows import COLUMNS
from scenicq.importers.ingest import ingest


@pytest.fixture(scope="module")
def parked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("parked")
    from pathlib import Path

    source = Path(__file__).parents[2] / "sample_data" / "parked"
    ingest(source, folder / "street")
    return source, folder


@pytest.fixture
def judge(run, parked):
    source, folder = parked
    results = folder / "parked_car.jsonl"
    if not results.exists():
        assert (
            run("match", str(source / "parked_car.scenic"), str(folder / "street"), "-o", str(results)).exit_code == 0
        )

    def call(*more, predictions="predictions.jsonl", files=(results,)):
        words = ["evaluate", *map(str, files), str(folder / "street"), "--predictions", str(source / predictions)]
        return run(*words, *map(str, more))

    return call


def test_table(judge, parked):
    done = judge("--simulated", parked[0] / "runs.csv")
    assert done.exit_code == 0, done.output
    last = done.stdout.rstrip().splitlines()[-2:]
    assert last[0].startswith("missed ")
    assert " of role parkedCar against " in last[0]
    assert last[0].endswith("over 16 recordings")
    assert last[1].endswith("the recordings speak for the failure")


def test_formats(judge, tmp_path):
    found = json.loads(judge("--format", "json").stdout)
    assert found["scenarios"][0]["roles"][0]["about"] == "role parkedCar"
    rows = list(csv.DictReader(io.StringIO(judge("--format", "csv").stdout)))
    assert list(rows[0]) == list(COLUMNS)
    for name in ("a.json", "a.csv", "a.parquet"):
        assert judge("-o", tmp_path / name).exit_code == 0
    assert json.loads((tmp_path / "a.json").read_text()) == found
    assert pq.read_table(tmp_path / "a.parquet").num_rows == len(rows)


def test_report(judge, tmp_path):
    assert judge("--report", tmp_path / "pages").exit_code == 0
    assert "Worst frames" in (tmp_path / "pages" / "index.html").read_text()


def test_refusals(judge, parked, tmp_path):
    done = judge(predictions="labels.jsonl")
    assert done.exit_code == 2
    assert "file-invalid" in done.stderr
    twice = judge(files=(parked[1] / "parked_car.jsonl",) * 2)
    assert twice.exit_code == 2
    assert "different names" in twice.stderr
    (tmp_path / "pages").mkdir()
    (tmp_path / "pages" / "mine").touch()
    assert "target-exists" in judge("--report", tmp_path / "pages").stderr


def test_ranked_matches(run, parked, tmp_path):
    source, folder = parked
    words = ["match", str(source / "parked_car.scenic"), str(folder / "street"), "--rank"]
    found = [json.loads(line) for line in run(*words).stdout.splitlines()]
    logs = [each["log_density"] for each in found]
    known = [log for log in logs if log is not None]
    assert known == sorted(known, reverse=True)
    assert logs == known + [None] * (len(logs) - len(known))
    for name in ("a.csv", "a.parquet"):
        assert run(*words, "-o", tmp_path / name).exit_code == 0
    rows = list(csv.DictReader((tmp_path / "a.csv").open()))
    assert [row["log_density"] for row in rows] == ["" if log is None else str(log) for log in logs]
    assert pq.read_table(tmp_path / "a.parquet")["log_density"].to_pylist() == logs
    assert run(*words, "--format", "table").exit_code == 0


def test_samples_of_matches(run, parked):
    source, folder = parked
    words = ["match", str(source / "parked_car.scenic"), str(folder / "street"), "--format", "ids", "--sample", "16"]
    plain, spread = run(*words).stdout.splitlines(), run(*words, "--diverse").stdout.splitlines()
    assert len(plain) == len(spread) == 16
    assert len({frame.partition("/")[0] for frame in spread}) == 16
    assert run(*words[:-2], "--diverse").exit_code == 2
    assert run(*words, "--shard", "1/2", "-o", "x").exit_code == 2


def test_from_python(parked):
    import scenicq

    source, folder = parked
    matches = scenicq.open(folder / "street").match(source / "parked_car.scenic")
    assert "missed" in str(matches.evaluate(source / "predictions.jsonl", simulated=source / "runs.csv"))
