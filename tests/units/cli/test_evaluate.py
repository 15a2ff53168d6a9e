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

    source = Path(__file__).parents[3] / "sample_data" / "parked"
    ingest(source, folder / "street")
    return source, folder


@pytest.fixture
def judge(run, parked):
    source, folder = parked
    results = folder / "parked_car.jsonl"
    if not results.exists():
        assert (
            run("match", source / "parked_car.scenic", folder / "street", "--all-matches", "-o", results).exit_code == 0
        )

    def call(*more, predictions="predictions.jsonl", files=(results,)):
        words = ["evaluate", *map(str, files), str(folder / "street"), "--predictions", str(source / predictions)]
        return run(*words, *map(str, more))

    return call


@pytest.mark.slow
def test_table(judge, parked):
    done = judge("--simulated", parked[0] / "runs.csv")
    assert done.exit_code == 0, done.output
    verdict, beside, failures = done.stdout.rstrip().splitlines()[-3:]
    assert verdict.startswith("missed ")
    assert " of role parkedCar against " in verdict
    assert verdict.endswith("over 16 recordings: worse than others that are alike")
    assert beside.startswith("role parkedCar: 44 beside others of the same frame, ")
    assert failures.endswith("the recordings speak for the failure")


@pytest.mark.slow
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


@pytest.mark.slow
def test_matches_without_a_density_are_told(run, parked, tmp_path):
    """A square is no density that can be told: in the table and on standard error."""
    program = tmp_path / "square.scenic"
    text = (parked[0] / "parked_car.scenic").read_text()
    program.write_text(text.replace("gap = Range(4, 20)", "half = Range(1, 4)\ngap = half * half + 4"))
    done = run("match", program, parked[1] / "street", "--rank", "--format", "table")
    count = sum("no density (" in line for line in done.stdout.splitlines())
    assert count > 20
    assert f"warning[no-density]: {count} of {count} matches have no density and come last: `position`" in done.stderr
    of_lines = [json.loads(line) for line in run("match", program, parked[1] / "street", "--rank").stdout.splitlines()]
    assert {each["log_density"] for each in of_lines} == {None}
    assert all("solved" in each["no_density"] for each in of_lines)


@pytest.mark.slow
def test_a_program_is_matched_with_all_who_can_play_a_role(run, parked, tmp_path):
    source, folder = parked
    words = [folder / "street", "--predictions", source / "predictions.jsonl", "--format", "json"]
    file = tmp_path / "parked_car.csv"
    for name in ("csv", "parquet", "jsonl"):
        file = tmp_path / f"parked_car.{name}"
        run("match", source / "parked_car.scenic", folder / "street", "--all-matches", "-o", file)
        of_file = run("evaluate", file, *words)
        assert of_file.exit_code == 0, of_file.output
        assert of_file.stdout == run("evaluate", source / "parked_car.scenic", *words).stdout
    one_each = tmp_path / "one_each.jsonl"
    run("match", source / "parked_car.scenic", folder / "street", "-o", one_each)
    done = run("evaluate", one_each, *words)
    assert "[one-correspondence]" in done.stderr
    (role,) = json.loads(done.stdout)["scenarios"][0]["roles"]
    assert role["controls"]["frame"] == 0


@pytest.mark.slow
def test_clusters_and_margins(run, judge, tmp_path):
    def role(*words):
        done = judge(*words, "--format", "json")
        assert done.exit_code == 0, done.output
        return json.loads(done.stdout)["scenarios"][0]["roles"][0]

    by_weather = role("--cluster", "weather")
    assert by_weather["unit"] == "weather"
    assert by_weather["says"] == "too little"
    assert by_weather["missed"]["low"] is None
    assert "equally large weathers would tell" in by_weather["because"]
    assert role("--cluster", "recording")["unit"] == "recording"
    assert role("--margin", "0.2")["margin"] == 0.2
    done = judge("--cluster", "drive")
    assert done.exit_code == 2
    assert "no frame has a parameter `drive`" in done.stderr
    assert "it may be recording, weather" in done.stderr


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


@pytest.mark.slow
def test_the_table_has_units_and_says_what_the_program_says(run, judge, parked, tmp_path):
    table = judge().stdout
    assert "TRANSLATION (m)" in table
    assert "SCALE (1 - IoU)" in table
    assert "ORIENTATION (rad)" in table
    assert "  Range(4, 20) (6:7)  " in table
    assert "parked_car.scenic:6:7" not in table
    (one,) = json.loads(judge("--format", "json").stdout)["scenarios"]
    sources = {each["by"]: each.get("source") for each in one["slices"]}
    assert (sources["parked_car.scenic:6:7"], sources["distance"]) == ("Range(4, 20)", None)
    # a file whose name has spaces, the program in place of results, and points
    program = tmp_path / "a b x.scenic"
    anywhere = "in everywhere, facing Range(0, 360) deg"
    text = (
        "model scenic.domains.driving.model\nego = new Car {0}\nother = new Car {0}\nrequire (distance to other) < 20\n"
    )
    program.write_text(text.format(anywhere))
    source, folder = parked
    done = run("evaluate", program, folder / "street", "--predictions", source / "predictions.jsonl")
    assert done.exit_code == 0, done.output
    assert "x of in everywhere (2:15)" in done.stdout
    assert "Range(0, 360) (2:37)" in done.stdout
