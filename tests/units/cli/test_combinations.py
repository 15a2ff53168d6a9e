"""Which options of `scenicq match` go together."""

from __future__ import annotations

import pytest

PROGRAM = "ego = new Car"


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (("--diverse",), "--diverse needs --sample N"),
        (("--resume",), "--resume needs -o FILE"),
        (("--resume", "-o", "-"), "--resume needs -o FILE"),
        (("--shard", "1/2"), "--shard needs -o FOLDER"),
        (("--shard", "1/2", "-o", "pieces", "--rank"), "--shard cannot be combined with --rank"),
        (("--shard", "1/2", "-o", "pieces", "--sample", "2"), "--shard cannot be combined with --sample"),
        (("--shard", "1/2", "-o", "pieces", "--advise"), "--shard cannot be combined with --advise"),
        (("--shard", "1/2", "-o", "pieces", "--report", "r"), "--report: give it to `scenicq gather`"),
        (("--advise", "--min-duration", "1"), "--advise is about frames"),
    ],
)
def test_what_does_not_go_together_is_refused_before_anything_is_done(
    run, crossroads, tmp_path, monkeypatch, given, told
):
    monkeypatch.chdir(tmp_path)
    found = run("match", "-e", PROGRAM, crossroads, *given)
    assert (found.exit_code, found.stdout, list(tmp_path.iterdir())) == (2, "", [])
    assert told in " ".join(found.stderr.split())


def test_what_goes_together_is_not(run, crossroads):
    assert run("match", "-e", PROGRAM, crossroads, "--diverse", "--sample", "2", "--format", "ids").exit_code == 0
    assert run("match", "-e", PROGRAM, crossroads, "--near", "1", "--format", "ids").exit_code == 0
