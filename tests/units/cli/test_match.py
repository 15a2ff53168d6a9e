"""`scenicq match`: results, formats, exit codes, the summary, and what is said about bad input."""

import csv
import io
import json
import math
import re

import pyarrow.parquet as pq
import pytest

from scenicq.forest.scenario import BuiltIn
from scenicq.query.execution.records import json_text
from scenicq.query.execution.result_tables import read_row
from scenicq.query.execution.run import Query

KEYS = ["frame", "recording", "timestamp_us", "verdict", "correspondence", "witness", "sensors", "dataset"]
FRAMES = [f"03-busy-intersection/{number:02}" for number in range(9, 14)]


@pytest.fixture
def crossing(scenarios):
    return scenarios / "02_crossing_cars.scenic"


@pytest.fixture
def nothing(tmp_path):
    """A scenario that no frame of the sample data matches."""
    file = tmp_path / "nothing.scenic"
    file.write_text("model scenic.domains.driving.model\nego = new Car on road\nrequire ego.position.x > 100000\n")
    return file


def test_in_a_pipe_results_are_json_lines_and_stderr_is_empty(installed, crossroads, crossing, tmp_path):
    done = installed("match", crossing, crossroads, cwd=tmp_path)
    records = [json.loads(line) for line in done.stdout.splitlines()]
    assert (done.returncode, done.stderr) == (0, "")
    assert [record["frame"] for record in records] == FRAMES
    summary = records[-1].pop("summary")
    texts = summary.pop("variables").values()
    assert summary == {"version": 1, "complete": True, "results": 5, "frames": 156}
    assert all(each in crossing.read_text() for each in texts)
    assert all(list(record) == KEYS for record in records)
    assert records[0]["correspondence"] == {"ego": "ego", "leftward": "car-left-1", "rightward": "car-right-1"}
    assert list(tmp_path.iterdir()) == []


def test_exit_codes_are_those_of_grep(run, crossroads, crossing, nothing):
    assert run("match", crossing, crossroads).exit_code == 0
    result = run("match", nothing, crossroads)
    assert (result.exit_code, result.stdout) == (1, "")
    assert run("match", nothing, crossroads, "--exit-zero").exit_code == 0


def test_no_match_says_why(run, crossroads, nothing):
    told = run("match", nothing, crossroads, "--summary").stderr
    assert "0  matches" in told
    assert "first failed at" in told
    assert "ego.position.x > 100000" in told


def test_the_summary_is_a_funnel(run, crossroads, crossing):
    result = run("match", crossing, crossroads, "--summary")
    lines = [line.split() for line in result.stderr.splitlines()]
    assert lines[:5] == [
        ["156", "frames"],
        ["5", "after", "the", "prefilter"],
        ["5", "with", "a", "label", "object", "for", "every", "role"],
        ["5", "matches"],
        ["0", "unknown"],
    ]
    table = lines[lines.index(["first", "failed", "at", "frames", "share"]) + 1 : -3]
    counts = [int(row[-2]) for row in table]
    assert counts == sorted(counts, reverse=True)
    assert sum(counts) == 156 - 5
    assert "waived: containment, collision" in result.stderr
    assert "tolerance: position=0.25,heading=5deg" in result.stderr


def test_the_summary_says_what_is_waived_and_where_it_stopped(run, crossroads, crossing):
    enforced = run("match", crossing, crossroads, "--summary", "--enforce", "containment, collision").stderr
    assert "waived" not in enforced
    assert (
        "waived: visibility, containment, collision"
        in run("match", crossing, crossroads, "--summary", "--enforce", "none").stderr
    )
    limited = run("match", crossing, crossroads, "--summary", "--limit", "1", "--no-prefilter").stderr
    assert "frames of 156 looked at (stopped at --limit)" in limited
    assert "the prefilter is off" in limited


def test_formats(run, crossroads, crossing, tmp_path):
    rows = list(csv.DictReader(io.StringIO(run("match", crossing, crossroads, "--format", "csv").stdout)))
    assert [row["frame"] for row in rows] == FRAMES
    assert json.loads(rows[0]["correspondence"])["leftward"] == "car-left-1"
    assert run("match", crossing, crossroads, "--format", "ids").stdout.splitlines() == FRAMES
    table = run("match", crossing, crossroads, "--format", "table").stdout.splitlines()
    assert table[0].split() == ["FRAME", "RECORDING", "TIME", "VERDICT", "OBJECTS", "SENSOR"]
    assert len({line.index(" match ") for line in table[1:]}) == 1
    assert "\x1b" not in "".join(table)


@pytest.mark.parametrize(
    ("words", "read"),
    [
        ("--format ids", False), ("--format jsonl", True), ("--format ids --all-matches", True),
        ("--format ids --export interchange OUT", True), ("--format ids --report OUT", True),
        ("--format ids --resume -o OUT", True),
    ],
)  # fmt: skip
@pytest.mark.one_in(2)
def test_of_ids_alone_nobody_reads_proofs(run, crossroads, crossing, tmp_path, monkeypatch, words, read):
    told = []

    def noted(dataset, source, options, **more):
        told.append(options.proofs)
        return Query(dataset, source, options, **more)

    monkeypatch.setattr("scenicq_cli.match.Query", noted)
    assert run("match", crossing, crossroads, *words.replace("OUT", str(tmp_path / "out")).split()).exit_code == 0
    assert told[0] is read


def test_a_file_s_extension_says_its_format(run, crossroads, crossing, tmp_path):
    for name in ("a.parquet", "a.csv", "a.jsonl", "a.txt"):
        result = run("match", crossing, crossroads, "-o", tmp_path / name)
        assert (result.exit_code, result.stdout) == (0, "")
    table = pq.read_table(tmp_path / "a.parquet")
    assert table.column("frame").to_pylist() == FRAMES
    assert table.column("timestamp_us").to_pylist()[0] == 1700007204500000
    assert [channel for channel, _ in table.column("sensors").to_pylist()[0]] == ["CAM_FRONT"]
    lines = [json.loads(line) for line in (tmp_path / "a.jsonl").read_text().splitlines()]
    assert table.column("correspondence").to_pylist() == [line["correspondence"] for line in lines]
    (origin,) = {line.pop("dataset") for line in lines}
    assert json.loads(pq.read_metadata(tmp_path / "a.parquet").metadata[b"scenicq.summary"]) == lines[-1].pop("summary")
    assert table.schema.metadata[b"scenicq.dataset"].decode() == origin
    assert [json.loads(json_text(read_row(row))) for row in table.to_pylist()] == lines
    cells = csv.DictReader(io.StringIO((tmp_path / "a.csv").read_text()))
    assert {row["dataset"] for row in cells} == {origin}
    assert re.fullmatch("crossroads@[0-9a-f]{8}", origin)
    assert (tmp_path / "a.txt").read_text().split() == FRAMES
    assert [json.loads(line)["frame"] for line in (tmp_path / "a.jsonl").read_text().splitlines()] == FRAMES
    assert (tmp_path / "a.csv").read_text().count("\n") == 1 + len(FRAMES)
    assert len(list(tmp_path.iterdir())) == 4


def test_nothing_found_still_gives_a_readable_file(run, crossroads, nothing, tmp_path):
    assert run("match", nothing, crossroads, "-o", tmp_path / "a.parquet").exit_code == 1
    assert pq.read_table(tmp_path / "a.parquet").num_rows == 0


def test_an_error_leaves_the_old_file(run, crossroads, tmp_path):
    file, bad = tmp_path / "a.jsonl", tmp_path / "bad.scenic"
    file.write_text("before")
    bad.write_text("ego = new Car at nowhere\n")
    assert run("match", bad, crossroads, "-o", file).exit_code == 2
    assert file.read_text() == "before"
    assert sorted(tmp_path.iterdir()) == [file, bad]


def test_all_shows_every_frame_with_its_cause(run, crossroads, crossing):
    records = [json.loads(line) for line in run("match", crossing, crossroads, "--all").stdout.splitlines()]
    assert len(records) == 156
    assert [record["frame"] for record in records if record["verdict"] == "match"] == FRAMES
    assert all(record["cause"]["what"] for record in records if record["verdict"] == "no_match")
    ids = run("match", crossing, crossroads, "--all", "--format", "ids").stdout.splitlines()
    assert ids == FRAMES


@pytest.mark.slow
def test_two_processes_and_no_prefilter_give_the_same_output(installed, crossroads, crossing, tmp_path):
    plain = installed("match", crossing, crossroads, cwd=tmp_path).stdout
    assert installed("match", crossing, crossroads, "--jobs", "2", cwd=tmp_path).stdout == plain
    assert installed("match", crossing, crossroads, "--no-prefilter", cwd=tmp_path).stdout == plain


def test_options_reach_the_matcher(run, crossroads, crossing, monkeypatch):
    seen = {}

    class Spy:
        def __init__(self, dataset, source, options):
            seen["options"] = options
            raise KeyboardInterrupt

    monkeypatch.setattr("scenicq_cli.match.Query", Spy)
    given = (
        "--tolerance x=0.25,y=0.5,heading=5deg --classes coarse --ego any --radius 50 --enforce collision --exact "
        "--solver portable --method smt --no-prefilter --jobs 3 --timeout 2.5 --limit 7 --all --scenic 2 --initial "
        "--ignore-params weather,time"
    ).split()
    assert run("match", crossing, crossroads, *given).exit_code == 130
    query = seen["options"]
    options = query.match
    assert (query.solver, query.version, query.initial, query.prefilter) == ("portable", 2, True, False)
    assert (query.jobs, query.limit, query.every) == (3, 7, True)
    assert (options.tolerance.x, options.tolerance.y, options.tolerance.heading) == (0.25, 0.5, math.radians(5))
    assert (options.classes, options.ego, options.radius, options.exact) == ("coarse", "any", 50.0, True)
    assert options.enforce == {BuiltIn.VISIBILITY, BuiltIn.COLLISION}
    assert (options.method, options.timeout_s) == ("smt", 2.5)
    assert {"weather", "time", "map"} <= options.ignore_params


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        (["nofile.scenic", "DATASET"], "file-missing", "nofile.scenic"),
        (["SCENARIO", "nowhere"], "store-missing", "nowhere"),
        (["SCENARIO", "FOLDER"], "store-missing", "dataset.json"),
        (["SCENARIO", "SCENARIO"], "store-missing", "dataset.json"),
        (["FOLDER", "DATASET"], "file-missing", "cannot be read"),
        (["SCENARIO", "DATASET", "--tolerance", "position=-1"], "option-invalid", "not negative"),
        (["SCENARIO", "DATASET", "--tolerance", "wheel=1"], "option-invalid", "position="),
        (["SCENARIO", "DATASET", "--tolerance", "x=1"], "option-invalid", "go together"),
        (["SCENARIO", "DATASET", "--tolerance", "egoo.heading=5deg"], "option-invalid", "`ego`"),
        (["SCENARIO", "DATASET", "--enforce", "gravity"], "option-invalid", "gravity"),
        (["SCENARIO", "DATASET", "-o", "matches.xyz"], "option-invalid", ".parquet"),
        (["SCENARIO", "DATASET", "-o", "no/folder/matches.csv"], "target-unwritable", "No such file"),
        (["SCENARIO", "DATASET", "--method", "smt", "--solver", "no-such-solver"], "solver-missing", "no-such-solver"),
    ],
)
def test_bad_input_gives_one_diagnostic(run, crossroads, crossing, tmp_path, monkeypatch, args, code, words):
    monkeypatch.chdir(tmp_path)
    names = {"SCENARIO": str(crossing), "DATASET": str(crossroads), "FOLDER": str(tmp_path)}
    result = run("match", *(names.get(arg, arg) for arg in args))
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith(f"error[{code}]: ")
    assert result.stderr.count("error[") == 1
    assert words in result.stderr


def test_a_mistake_in_the_scenario_is_shown_in_its_place(run, crossroads, tmp_path):
    file = tmp_path / "mistake.scenic"
    file.write_text("model scenic.domains.driving.model\nego = new Car facing roadDirecton\n")
    result = run("match", file, crossroads)
    assert result.exit_code == 2
    assert f"--> {file}:2:22" in result.stderr
    assert "^^^^^^^^^^^^" in result.stderr


def test_a_program_that_is_no_text(run, crossroads, tmp_path):
    file = tmp_path / "picture.scenic"
    file.write_bytes(b"\x89PNG\xff\xfe")
    result = run("match", file, crossroads)
    assert (result.exit_code, result.stderr.startswith("error[file-invalid]")) == (2, True)


def test_nothing_that_comes_close_is_told_and_not_advised_again(run, crossroads):
    text = "model scenic.domains.driving.model\nego = new Car\nother = new Car\nrequire (distance to other) < 0.01"
    found = run("match", "-e", text, crossroads, "--near", "3")
    assert found.exit_code == 1
    assert "--near shows nothing" in found.stderr
    assert "`--near 3`" not in found.stderr
    assert "`--near 3`" in run("match", "-e", text, crossroads).stderr


def test_so_is_it_over_time(run, crossroads):
    text = "model scenic.domains.driving.model\nego = new Car\nother = new Car\nrequire (distance to other) < 0.01\n"
    found = run("match", "-e", text + "require always (distance to other) < 90", crossroads, "--near", "3")
    assert found.exit_code == 1
    assert "--near shows nothing: no recording" in found.stderr


def test_a_name_like_an_option_is_told_how_to_stand(run, crossroads):
    wrong = run("explain", "-e", "ego = new Car", crossroads, "-7-frame")
    assert wrong.exit_code == 2
    assert "stands after '--'" in wrong.stderr
    right = run("explain", "-e", "ego = new Car", crossroads, "--", "-7-frame")
    assert "no frame" in right.stderr.lower() or "-7-frame" in right.stderr
