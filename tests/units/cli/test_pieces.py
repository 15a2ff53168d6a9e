"""Shards, gathering and going on after an interruption, through the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.records import decode_record, json_text, read_record, record
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset

TOLERANCE = ("--tolerance", "x=0.25,y=0.25,heading=5deg", "--classes", "coarse")


@pytest.fixture
def program(scenarios: Path) -> Path:
    return scenarios / "01_pedestrian_facing_ego.scenic"


def test_shards_gathered_are_the_whole(run, program, crossroads, tmp_path):
    whole = run("match", program, crossroads, *TOLERANCE, "--format", "jsonl")
    assert whole.exit_code == 0
    for number in (3, 1, 2, 4):
        found = run("match", program, crossroads, *TOLERANCE, "--shard", f"{number}/4", "-o", tmp_path / "pieces")
        assert found.exit_code in (0, 1), found.output
    gathered = run("gather", tmp_path / "pieces", "--format", "jsonl")
    assert gathered.exit_code == 0
    assert gathered.stdout == whole.stdout


def test_a_shard_that_is_done_is_not_done_again(run, program, crossroads, tmp_path):
    run("match", program, crossroads, *TOLERANCE, "--shard", "1/2", "-o", tmp_path)
    (file,) = tmp_path.glob("*.jsonl")
    before = file.stat().st_mtime_ns
    again = run("match", program, crossroads, *TOLERANCE, "--shard", "1/2", "-o", tmp_path, "--summary")
    assert file.stat().st_mtime_ns == before
    assert "matches" in again.stderr


def test_a_missing_shard_is_named(run, program, crossroads, tmp_path):
    run("match", program, crossroads, *TOLERANCE, "--shard", "1/3", "-o", tmp_path)
    found = run("gather", tmp_path)
    assert found.exit_code == 2
    assert "2 of 3 pieces are missing: 2, 3" in found.stderr


def test_a_resumed_run_writes_the_same_file_and_cleans_up(run, program, crossroads, tmp_path):
    run("match", program, crossroads, *TOLERANCE, "-o", tmp_path / "whole.jsonl")
    found = run("match", program, crossroads, *TOLERANCE, "-o", tmp_path / "resumed.jsonl", "--resume")
    assert found.exit_code == 0
    assert (tmp_path / "resumed.jsonl").read_text() == (tmp_path / "whole.jsonl").read_text()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["resumed.jsonl", "whole.jsonl"]
    assert all(json.loads(line)["verdict"] == "match" for line in (tmp_path / "whole.jsonl").read_text().splitlines())


@pytest.mark.parametrize("shard", ["0/4", "5/4", "1", "a/b", "1/0", "-1/4"])
def test_a_bad_shard_is_a_usage_error(run, program, crossroads, tmp_path, shard):
    found = run("match", program, crossroads, "--shard", shard, "-o", tmp_path)
    assert found.exit_code == 2
    assert "I/N" in found.stderr


def test_a_run_that_fails_at_once_leaves_nothing_to_resume(run, crossroads, tmp_path):
    (tmp_path / "bad.scenic").write_text("ego = new Car at nowhere\n")
    for jobs in (1, 2):
        found = run(
            "match", tmp_path / "bad.scenic", crossroads, "-o", tmp_path / "x.jsonl", "--resume", "--jobs", jobs
        )
        assert (found.exit_code, found.stderr.count("error[")) == (2, 1)
    assert [path.name for path in tmp_path.iterdir()] == ["bad.scenic"]


def test_resuming_needs_a_place(run, program, crossroads):
    found = run("match", program, crossroads, "--resume")
    assert (found.exit_code, found.stderr.count("Error:")) == (2, 1)
    assert "--resume needs -o FILE" in found.stderr


@pytest.mark.parametrize(
    "extra", [("--limit", "1"), ("--near", "2"), ("--resume",), ("--export", "paths", "out"), ("--report", "out")]
)
def test_a_shard_goes_alone(run, program, crossroads, tmp_path, monkeypatch, extra):
    monkeypatch.chdir(tmp_path)
    found = run("match", program, crossroads, "--shard", "1/2", "-o", "pieces", *extra)
    assert (found.exit_code, list(tmp_path.iterdir())) == (2, [])
    assert extra[0] in found.stderr
    assert ("scenicq gather" in found.stderr) == (extra[0] in ("--export", "--report"))


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow
def test_what_is_gathered_or_resumed_can_be_exported_and_reported(run, program, crossroads, tmp_path):
    given = ("match", program, crossroads, *TOLERANCE)
    plain = run(*given, "--export", "interchange", tmp_path / "a", "-o", tmp_path / "a.jsonl")
    assert plain.exit_code == 0, plain.stderr
    told = ("--export", "interchange", tmp_path / "b", "--report", tmp_path / "b.report", "-o", tmp_path / "b.jsonl")
    assert run(*given, "--resume", *told).exit_code == 0
    assert (tmp_path / "b.jsonl").read_text() == (tmp_path / "a.jsonl").read_text()
    for number in (1, 2, 3):
        run(*given, "--shard", f"{number}/3", "-o", tmp_path / "pieces")
    told = ("--export", "interchange", tmp_path / "c", "--report", tmp_path / "c.report", "-o", tmp_path / "c.jsonl")
    gathered = run("gather", tmp_path / "pieces", *told)
    assert gathered.exit_code == 0, gathered.stderr
    assert files(tmp_path / "a") == files(tmp_path / "b") == files(tmp_path / "c") != {}
    recording = json.loads((tmp_path / "a.jsonl").read_text().splitlines()[0])["recording"]
    reports = [(tmp_path / name / "index.html").read_text() for name in ("b.report", "c.report")]
    assert all(recording in text for text in reports)
    (question,) = (tmp_path / "pieces").glob("*.json")
    question.write_text("{}")
    refused = run("gather", tmp_path / "pieces", "--report", tmp_path / "d.report")
    assert (refused.exit_code, refused.stderr.startswith("error[file-invalid]")) == (2, True)
    question.unlink()
    refused = run("gather", tmp_path / "pieces", "--report", tmp_path / "d.report")
    assert (refused.exit_code, refused.stderr.startswith("error[file-missing]")) == (2, True)
    assert not (tmp_path / "d.report").exists()


def test_records_come_back_as_they_were(run, scenarios, crossroads):
    source = read_program(scenarios / "02_crossing_cars.scenic")
    for options in (
        QueryOptions(every=True),
        QueryOptions(MatchOptions(tolerance=EXACT, method="smt", timeout_s=1e-6), prefilter=False),
    ):
        records = [record(result) for result in Query(open_dataset(crossroads), source, options).results()]
        assert records
        assert [record(read_record(decode_record(json_text(each)), source)) for each in records] == records


def test_an_engine_that_is_unknown_is_a_usage_error(run, program, crossroads, tmp_path):
    for engine in ("spark", "dask=", "="):
        found = run("match", program, crossroads, "--engine", engine)
        assert (found.exit_code, "dask=ADDRESS" in found.stderr) == (2, True)
    found = run("match", program, crossroads, "--engine", "dask", "--shard", "1/2", "-o", tmp_path)
    assert (found.exit_code, "--engine" in found.stderr) == (2, True)


def test_the_plan_is_printed_with_the_frames_left_after_each_step(run, program, crossroads):
    found = run("match", program, crossroads, *TOLERANCE, "--explain")
    assert found.exit_code == 0, found.stderr
    assert "map crossroads: 156 frames" in found.stdout
    steps = [line.split() for line in found.stdout.splitlines() if program.name in line]
    left = [int(words[0]) for words in steps]
    assert left == sorted(left, reverse=True)
    assert any("pedestrian.class" in words for words in steps)
    assert "memberships" in found.stdout


@pytest.mark.parametrize("after", [0, 1, 3])
def test_a_shard_that_is_stopped_leaves_no_file(run, crossroads, program, tmp_path, monkeypatch, after):
    """SIGTERM is an interrupt like Ctrl-C; the next run does what was not done."""
    real = Query.results

    def stopped(query, *given):
        for number, result in enumerate(real(query, *given)):
            if number >= after:
                raise KeyboardInterrupt
            yield result

    words = ("match", program, crossroads, "--all", "--shard", "1/2", "-o", tmp_path / "pieces")
    with monkeypatch.context() as patch:
        patch.setattr(Query, "results", stopped)
        assert run(*words).exit_code == 130
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]
    assert run(*words).exit_code == 0
    assert run(*words[:-3], "2/2", *words[-2:]).exit_code in (0, 1)
    assert run("gather", tmp_path / "pieces").exit_code == 0
