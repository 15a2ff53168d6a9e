"""A killed command is mended by its next run: a short part of `kills.py`."""

import os
import shutil

import pytest
from kills import SIGNALS, killed, outcome_after, prepare, writers


@pytest.mark.parametrize("number", SIGNALS)
@pytest.mark.parametrize(("kind", "after_s"), [("index", 0.6), ("sample", 0.8), ("report", 1.0)])
@pytest.mark.slow
def test_the_next_run_comes_to_the_same_end(kind, after_s, number, crossroads, tmp_path):
    environment = {**os.environ, "XDG_STATE_HOME": str(tmp_path / "state")}
    shutil.copytree(crossroads, tmp_path / "copy")
    words, target = writers(tmp_path, crossroads, tmp_path)[kind]
    killed(words, environment, after_s, number)
    assert outcome_after(words, target, environment) == "mended"


@pytest.mark.slow
def test_every_command_that_is_killed_does_its_work_otherwise(run, crossroads, tmp_path):
    made = tmp_path / "made before"
    prepare(made, crossroads)
    shutil.copytree(crossroads, tmp_path / "copy")
    for words, target in writers(tmp_path, crossroads, made).values():
        assert run(*words).exit_code == 0
        assert target.exists()
