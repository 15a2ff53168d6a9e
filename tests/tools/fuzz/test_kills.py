"""A killed command is mended by its next run: a short part of `kills.py`."""

import os
import shutil

import pytest
from kills import PROGRAM, killed, outcome_after, writers


@pytest.mark.parametrize(("kind", "after_s"), [("index", 0.6), ("sample", 0.8), ("report", 1.0)])
@pytest.mark.one_in(3)
@pytest.mark.slow
def test_the_next_run_comes_to_the_same_end(kind, after_s, run, crossroads, tmp_path):
    environment = {**os.environ, "XDG_STATE_HOME": str(tmp_path / "state")}
    shutil.copytree(crossroads, tmp_path / "copy")
    words, target = writers(tmp_path, crossroads, tmp_path)[kind]
    killed(words, environment, after_s)
    assert outcome_after(words, target, environment) == "mended"


@pytest.mark.slow
def test_every_command_that_is_killed_does_its_work_otherwise(run, crossroads, tmp_path):
    pieces = tmp_path / "shards"
    assert run("match", PROGRAM, crossroads, "--shard", "1/1", "-o", pieces).exit_code == 0
    shutil.copytree(crossroads, tmp_path / "copy")
    for words, target in writers(tmp_path, crossroads, pieces).values():
        assert run(*words).exit_code == 0
        assert target.exists()
