"""Exit codes that a script can tell apart: matched, nothing matched, an error, something undecided."""

from __future__ import annotations

import json

import pytest

ANYWHERE = "in everywhere, facing Range(0, 360) deg"
PLAIN = f"ego = new Car {ANYWHERE}"
NOTHING = f"ego = new Car {ANYWHERE}; require ego.speed > 900"
PAIR = f"{PLAIN}; other = new Car {ANYWHERE}; require (distance to other) < 20"
CASES = {
    "matched": ((PLAIN,), 0),
    "nothing": ((NOTHING,), 1),
    "error": (("ego = new Nothing",), 2),
    "limit": ((PLAIN, "--limit", "2"), 3),
    "limit that is not reached": ((PLAIN, "--limit", "100000"), 0),
    "deadline": ((PLAIN, "--deadline", "1ms", "--no-prefilter"), 3),
    "deadline where nothing is found": ((NOTHING, "--deadline", "1ms", "--no-prefilter"), 3),
    "deadline that is kept": ((PLAIN, "--deadline", "1h"), 0),
    "unknown": ((PAIR, "--no-prefilter", "--method", "smt", "--timeout", "0.1ms"), 3),
}


@pytest.mark.parametrize("form", ["ids", "jsonl", "csv"])
@pytest.mark.parametrize("case", CASES)
@pytest.mark.one_in(4)
def test_a_query_says_how_it_ended(run, crossroads, case, form):
    (program, *options), code = CASES[case]
    done = run("match", "-e", program, crossroads, "--format", form, "-q", *options)
    assert done.exit_code == code, done.stderr
    eased = run("match", "-e", program, crossroads, "--format", form, "-q", *options, "--exit-zero")
    assert eased.exit_code == (2 if code == 2 else 0)


def test_a_shard_that_is_late_is_undecided_and_not_kept(run, crossroads, tmp_path):
    words = ("match", "-e", PLAIN, crossroads, "--shard", "1/2", "-o", tmp_path / "pieces", "--deadline", "1ms")
    done = run(*words, "--no-prefilter")
    assert done.exit_code == 3
    assert "deadline-passed" in done.stderr
    assert not (tmp_path / "pieces").exists()


def test_shards_put_together_end_as_the_query(run, crossroads, tmp_path):
    for name, (options, code) in CASES.items():
        if name not in ("matched", "nothing", "unknown"):
            continue
        folder = tmp_path / name
        for number in (1, 2):
            run("match", "-e", options[0], crossroads, "--shard", f"{number}/2", "-o", folder, *options[1:])
        assert run("gather", folder).exit_code == code, name


def test_an_explanation_says_the_same(run, crossroads):
    for name, code in (("matched", 0), ("nothing", 1), ("unknown", 3)):
        program, *options = CASES[name][0]
        lines = run("match", "-e", program, crossroads, "--all", "--no-prefilter", *options).stdout.splitlines()
        wanted = {0: "match", 1: "no_match", 3: "unknown"}[code]
        frame = next(each["frame"] for each in map(json.loads, lines) if each["verdict"] == wanted)
        shared = [each for each in options if each != "--no-prefilter"]
        assert run("explain", "-e", program, crossroads, frame, *shared).exit_code == code, name


def test_each_command_has_the_same_table(run):
    for command in ("match", "gather", "explain"):
        codes = run(command, "--help").stdout.split("Exit codes:")[1].splitlines()
        assert [line.split()[0] for line in codes if line.startswith("  ") and line[2].isdecimal()] == [
            "0", "1", "2", "3", "130",
        ]  # fmt: skip


NEAR = f"{PLAIN}; other = new Car {ANYWHERE}; require eventually (distance to other) < 12"
NEVER = f"{PLAIN}; other = new Car {ANYWHERE}; require eventually (distance to other) < 0.01"
LATE = ("--deadline", "1ms", "--no-prefilter")
VAGUE = ("--no-prefilter", "--method", "smt", "--timeout", "0.1ms")
ENDS: dict[str, tuple[tuple[str, ...], int]] = {
    "over time, matched": ((NEAR, "DATASET"), 0),
    "over time, nothing": ((NEVER, "DATASET"), 1),
    "over time, limit": ((NEAR, "DATASET", "--limit", "1"), 3),
    "over time, limit that is not reached": ((NEAR, "DATASET", "--limit", "999"), 0),
    "over time, deadline": ((NEAR, "DATASET", *LATE), 3),
    "over time, unknown": ((NEAR, "DATASET", *VAGUE), 3),
    "over time, near": ((NEVER, "DATASET", "--near", "2"), 1),
    "over time, error": ((f"{NEAR}; require eventually nobody", "DATASET"), 2),
    "a duration, matched": ((PLAIN, "DATASET", "--min-duration", "1"), 0),
    "a duration, nothing": ((NOTHING, "DATASET", "--min-duration", "1"), 1),
    "near where something matches": ((PLAIN, "DATASET", "--near", "2"), 0),
    "near where nothing does": ((NOTHING, "DATASET", "--near", "2"), 1),
    "near, cut by the limit": ((PLAIN, "DATASET", "--near", "2", "--limit", "1"), 3),
    "near, cut by the deadline": ((PLAIN, "DATASET", "--near", "2", *LATE), 3),
    "a sample": ((PLAIN, "DATASET", "--sample", "2"), 0),
    "a sample of nothing": ((NOTHING, "DATASET", "--sample", "2"), 1),
    "a sample where some are unknown": ((PAIR, "DATASET", "--sample", "2", *VAGUE), 3),
    "ranked, limit": ((PLAIN, "DATASET", "--rank", "--limit", "2"), 3),
    "a limit that ends with the last frame": ((PLAIN, "DATASET", "--limit", "156"), 0),
    "no dataset": ((PLAIN, "nowhere"), 2),
}


@pytest.mark.parametrize("case", ENDS)
@pytest.mark.one_in(12)
def test_the_installed_command_ends_as_the_table_says(installed, crossroads, tmp_path, case):
    words, code = ENDS[case]
    program, *rest = (str(crossroads) if each == "DATASET" else each for each in words)
    done = installed("match", "-e", program, *rest, "-q", "--format", "jsonl", cwd=tmp_path)
    assert done.returncode == code, done.stderr
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    if lines and "--sample" not in rest:
        # who reads the file comes to the same end as who reads the code
        said = lines[-1]["summary"]
        matched = any(each.get("verdict") == "match" for each in lines)
        assert code == (3 if said.get("skipped") or said.get("unknown") else 0 if matched else 1)


EXPLAINED = {
    "recording, matches": ((NEAR, "06-cut-in"), 0),
    "recording, does not match": ((NEVER, "06-cut-in"), 1),
    "recording, unknown": ((NEAR, "06-cut-in", "--method", "smt", "--timeout", "0.1ms"), 3),
    "recording, no frame that matches": ((f"{NEAR}; require ego.speed > 900", "06-cut-in"), 1),
    "frame over time, matches": ((NEAR, "06-cut-in/00"), 0),
    "frame over time, does not match": ((NEVER, "06-cut-in/00"), 1),
    "frame over time, unknown": ((NEAR, "06-cut-in/00", "--method", "smt", "--timeout", "0.1ms"), 3),
    "no such frame": ((PLAIN, "nowhere"), 2),
    "no such recording": ((NEAR, "nowhere@3"), 2),
}


@pytest.mark.parametrize("case", EXPLAINED)
@pytest.mark.one_in(6)
def test_an_explanation_over_time_ends_as_the_table_says(run, crossroads, case):
    (program, named, *options), code = EXPLAINED[case]
    done = run("explain", "-e", program, crossroads, named, *options)
    assert done.exit_code == code, done.output
    eased = run("explain", "-e", program, crossroads, named, *options, "--exit-zero")
    assert eased.exit_code == (2 if code == 2 else 0)
    if code == 3:
        assert "unknown" in done.stdout or "undecided" in done.stdout
        assert "fail at" not in done.stdout


@pytest.mark.parametrize("name", ["over time, matched", "over time, nothing", "over time, unknown"])
@pytest.mark.one_in(3)
def test_shards_over_time_end_as_the_query(run, crossroads, tmp_path, name):
    (program, _, *options), code = ENDS[name]
    words = ("match", "-e", program, crossroads, *options)
    ends = {run(*words, "--shard", f"{number}/3", "-o", tmp_path / "p").exit_code for number in (1, 2, 3)}
    assert run("gather", tmp_path / "p").exit_code == code
    assert run("gather", tmp_path / "p", "--exit-zero").exit_code == 0
    # each piece ends as its own part does
    assert min(ends) == code if code == 0 else ends == {code}
