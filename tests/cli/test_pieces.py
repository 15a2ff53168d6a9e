"""Shards, gathering and going on after an interruption, through the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

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
    (file,) = tmp_path.iterdir()
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


@pytest.mark.parametrize("extra", [(), ("-o", "x.jsonl", "--limit", "1"), ("-o", "x.jsonl", "--near", "2")])
def test_pieces_need_a_place_and_go_alone(run, program, crossroads, extra):
    found = run("match", program, crossroads, "--resume", *extra)
    assert found.exit_code == 2
    assert "--resume" in found.stderr


def test_the_plan_is_printed_with_the_frames_left_after_each_step(run, program, crossroads):
    found = run("match", program, crossroads, *TOLERANCE, "--explain")
    assert found.exit_code == 0, found.stderr
    assert "map crossroads: 156 frames" in found.stdout
    steps = [line.split() for line in found.stdout.splitlines() if program.name in line]
    left = [int(words[0]) for words in steps]
    assert left == sorted(left, reverse=True)
    assert any("pedestrian.class" in words for words in steps)
    assert "FROM memberships" in found.stdout
