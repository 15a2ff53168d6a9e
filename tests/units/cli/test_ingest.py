"""`scenicq ingest`: the summary, and what is said about bad input."""

import json
import shutil

import pytest

from scenicq.store.dataset import open_dataset


@pytest.fixture
def source(tmp_path):
    """A copy of the small sample source that a test may damage."""
    shutil.copytree(__file__.rpartition("tests")[0] + "sample_data/crossroads", tmp_path / "source")
    return tmp_path / "source"


def test_the_summary_goes_to_stderr(installed, source, tmp_path):
    done = installed("ingest", "source", "dataset", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    assert "dataset: 156 frames, 676 objects, 26 tracks in 6 recordings, read as interchange" in done.stderr
    assert ["Car", "286"] in [line.split() for line in done.stderr.splitlines()]
    assert open_dataset(tmp_path / "dataset").manifest.total.frames == 156


def test_quiet_is_silent_and_force_replaces(run, source, tmp_path):
    first = run("ingest", source, tmp_path / "dataset", "-q")
    assert (first.exit_code, first.output) == (0, "")
    again = run("ingest", source, tmp_path / "dataset", "-q")
    assert (again.exit_code, again.stderr.partition("]")[0]) == (2, "error[target-exists")
    assert run("ingest", source, tmp_path / "dataset", "-q", "--force").exit_code == 0


def _spoil(source, count):
    lines = (source / "labels.jsonl").read_text().splitlines()
    for number in range(count):
        label = json.loads(lines[number])
        label["objects"][0]["heading"] = "north"
        lines[number] = json.dumps(label)
    (source / "labels.jsonl").write_text("\n".join(lines) + "\n")


def test_what_is_left_out_is_counted_and_a_few_are_told(run, source, tmp_path):
    _spoil(source, 12)
    result = run("ingest", source, tmp_path / "dataset")
    assert result.exit_code == 0
    assert result.stderr.count("warning[record-invalid]") == 5
    assert "and 7 more of [record-invalid]" in result.stderr
    assert ["12", "object", "record-invalid"] in [line.split() for line in result.stderr.splitlines()]
    assert "left out:" in run("info", tmp_path / "dataset").stdout


def test_strict_stops_at_the_first_problem(run, source, tmp_path):
    _spoil(source, 2)
    result = run("ingest", source, tmp_path / "dataset", "--strict")
    assert (result.exit_code, result.stderr.count("error[")) == (2, 1)
    assert not (tmp_path / "dataset").exists()


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        (["nowhere", "dataset"], "file-missing", "nowhere"),
        (["EMPTY", "dataset"], "dataset-unrecognised", "interchange"),
        (["SOURCE", "dataset", "--format", "laserdisc"], "option-invalid", "nuscenes"),
        (["SOURCE", "dataset", "--map", "no.geojson"], "file-missing", "no.geojson"),
        (["SOURCE", "dataset", "--class-map", "no.json"], "file-missing", "no.json"),
        (["SOURCE", "dataset", "--class-map", "CLASSES"], "unknown-class", "Spaceship"),
        (["SOURCE", "SOURCE", "--force"], "target-exists", "source"),
    ],
)
def test_bad_input_gives_one_diagnostic(run, source, tmp_path, monkeypatch, args, code, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "classes.json").write_text('{"Car": "Spaceship"}')
    names = {"SOURCE": "source", "EMPTY": "empty", "CLASSES": "classes.json"}
    result = run("ingest", *(names.get(arg, arg) for arg in args))
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith(f"error[{code}]: ")
    assert result.stderr.count("error[") == 1
    assert words in result.stderr
    assert not (tmp_path / "dataset").exists()
    assert (source / "labels.jsonl").exists()
