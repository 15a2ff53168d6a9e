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
