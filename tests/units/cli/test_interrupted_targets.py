"""Reports and runs that go on: a kill leaves nothing that the next run refuses, and a second writer is told so."""

import sys
from pathlib import Path

import pytest

from scenicq.errors import DataError
from scenicq.store.targets import target_of

PROGRAM = Path(__file__).parents[3] / "sample_data/scenarios/02_crossing_cars.scenic"
needs_locks = pytest.mark.skipif(sys.platform == "win32", reason="there are no locks on folders")


@needs_locks
def test_a_second_writer_is_told(tmp_path):
    with target_of(tmp_path / "target").sole_writer():
        with pytest.raises(DataError, match="another run writes to"), target_of(tmp_path / "target").sole_writer():
            pass
        assert (tmp_path / "target").is_dir()
    assert not (tmp_path / "target").exists()
    with target_of(tmp_path / "target").sole_writer():
        (tmp_path / "target/file").touch()
    assert (tmp_path / "target/file").exists()


@needs_locks
def test_two_runs_that_go_on_with_one_file(run, crossroads, tmp_path):
    words = ("match", PROGRAM, crossroads, "--jobs", "1", "--resume", "-o", tmp_path / "found.jsonl")
    with target_of(tmp_path / ".found.jsonl.pieces").sole_writer():
        told = run(*words)
    assert told.exit_code == 2
    assert told.stderr.startswith("error[target-busy]")
    assert run(*words).exit_code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["found.jsonl"]


@needs_locks
def test_two_runs_with_one_report(run, crossroads, tmp_path):
    with target_of(tmp_path / "report").sole_writer():
        told = run("match", PROGRAM, crossroads, "--jobs", "1", "--report", tmp_path / "report")
    assert (told.exit_code, told.stdout) == (2, "")
    assert told.stderr.startswith("error[target-busy]")


@pytest.mark.parametrize("left", [(), ("pictures",), ("pictures", "thumbnails")])
def test_a_report_that_was_killed_is_written_again(run, crossroads, tmp_path, left):
    report = tmp_path / "report"
    for name in (".report-x1y2", *left):
        (report / name).mkdir(parents=True)
    told = run("match", PROGRAM, crossroads, "--jobs", "1", "--report", report)
    assert told.exit_code == 0, told.stderr
    assert (report / "index.html").is_file()
    assert not (report / ".report-x1y2").exists()


def test_a_folder_with_pictures_of_the_users_own_is_no_report(run, crossroads, tmp_path):
    (tmp_path / "report/pictures").mkdir(parents=True)
    told = run("match", PROGRAM, crossroads, "--jobs", "1", "--report", tmp_path / "report")
    assert told.exit_code == 2
    assert "target-exists" in told.stderr
