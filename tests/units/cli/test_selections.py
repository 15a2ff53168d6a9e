"""`--where` and `--sort` are the same in `match`, of gathered shards, in Python, and of matches that are there."""

from __future__ import annotations

import json

import pytest

from scenicq.errors import DataError
from scenicq.notebook.datasets import open as open_dataset

FRAMES = """model scenic.domains.driving.model
ego = new Car
other = new Car in everywhere, facing Range(-180, 180) deg
record (distance to other) as gap
record other.speed as speed
"""
INTERVALS = f"{FRAMES}require always (distance to other) < 40\nterminate after 1 seconds\n"
PROGRAMS = {"frames": FRAMES, "intervals": INTERVALS}
ASKED = {
    "frames": [
        {"where": "gap < 25"}, {"sort": "gap"}, {"where": "gap < 25 and not speed > 5", "sort": "speed:desc"},
        {"where": "speed > 1e9"},
    ],
    "intervals": [{"where": "gap.minimum < 25", "sort": "gap.mean:desc"}],
}  # fmt: skip
CASES = [
    pytest.param(kind, asked, marks=[pytest.mark.slow] if asked == {"sort": "gap"} else [])
    for kind, several in ASKED.items()
    for asked in several
]


def options(asked):
    return [word for name, value in asked.items() for word in (f"--{name}", value)]


def result_lines(text):
    """The results, of which a summary is told where there are none."""
    return [json.loads(line) for line in text.splitlines()]


@pytest.mark.parametrize(("kind", "asked"), CASES)
@pytest.mark.one_in(2)
def test_all_ways_show_the_same(run, crossroads, tmp_path, kind, asked):
    program = tmp_path / "p.scenic"
    program.write_text(PROGRAMS[kind])
    matched = run("match", program, crossroads, "--format", "jsonl", *options(asked))
    for number in (1, 2):
        run("match", program, crossroads, "--shard", f"{number}/2", "-o", tmp_path / "pieces")
    gathered = run("gather", tmp_path / "pieces", "--format", "jsonl", *options(asked))
    assert gathered.stdout == matched.stdout
    assert gathered.exit_code == matched.exit_code
    expected = [line for line in result_lines(matched.stdout) if "verdict" in line]
    for line in expected:
        line.pop("summary", None)

    dataset = open_dataset(crossroads)
    for found in (dataset.match(program, **asked), dataset.match(program).select(**asked)):
        assert [json.loads(json.dumps(each.record)) for each in found] == expected
        if expected:
            told = result_lines(matched.stdout)[-1]["summary"]
            assert (found.summary.left_out, found.summary.complete) == (told.get("left_out", 0), told["complete"])


def test_one_selection_after_another_is_both(crossroads):
    dataset = open_dataset(crossroads)
    found = dataset.match(FRAMES)
    both = dataset.match(FRAMES, where="(gap < 30) and (speed < 4)", sort="gap")
    after = found.select(where="gap < 30").select(where="speed < 4").select(sort="gap")
    assert [each.record for each in after] == [each.record for each in both]
    assert after.summary == both.summary
    assert 0 < len(after) < len(found)


def test_a_limit_counts_matches_that_are_shown(crossroads):
    dataset = open_dataset(crossroads)
    every = dataset.match(FRAMES, where="gap < 25", sort="gap")
    assert [each.frame for each in dataset.match(FRAMES, where="gap < 25", sort="gap", limit=3)] == [
        each.frame for each in every[:3]
    ]
    assert len(dataset.match(FRAMES, where="gap < 25", limit=2)) == 2


@pytest.mark.parametrize("asked", [{"where": "gip < 2"}, {"sort": "gip"}, {"where": "gap <"}, {"sort": "gap:up"}])
def test_what_is_not_recorded_is_refused_at_once(crossroads, asked):
    dataset = open_dataset(crossroads)
    with pytest.raises(DataError, match="option-invalid"):
        dataset.match(FRAMES, **asked)
    with pytest.raises(DataError, match="option-invalid"):
        dataset.match(FRAMES, limit=1).select(**asked)


def test_shards_leave_the_selection_to_gather(run, crossroads, tmp_path):
    (tmp_path / "p.scenic").write_text(FRAMES)
    done = run("match", tmp_path / "p.scenic", crossroads, "--shard", "1/2", "-o", tmp_path / "x", "--sort", "gap")
    assert "give it to `scenicq gather`" in done.stderr
