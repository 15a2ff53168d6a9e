"""What the system refuses leaves nothing: whatever runs out, whoever writes, the target is as it was."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from kills import COMMAND, outcome_after, prepare, writers

KINDS = tuple(writers(Path(), Path(), Path()))
LIMITS = [("RLIMIT_NOFILE", most) for most in (5, 6, 7, 8, 10, 13)] + [
    ("RLIMIT_FSIZE", most) for most in (0, 900, 20_000)
]
LIMITED_WRITERS = [
    (kind, *each)
    for row, kind in enumerate(KINDS)
    for column, each in enumerate(LIMITS)
    if row % 2 == column % 2  # each writer under half of them
]
LIMITED = (
    "import os, resource, sys; resource.setrlimit(getattr(resource, sys.argv[1]), (int(sys.argv[2]),) * 2); "
    "os.execv(sys.argv[3], sys.argv[3:])"
)


def contents(folder: Path) -> dict[str, bytes]:
    """Every file and folder."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else b"" for path in folder.rglob("*")
    }


@pytest.fixture(scope="module")
def made(crossroads, tmp_path_factory):
    folder = tmp_path_factory.mktemp("before") / "made"
    prepare(folder, crossroads)
    return folder


@pytest.mark.skipif(sys.platform != "linux", reason="limits are those of Linux")
@pytest.mark.parametrize(("kind", "limit", "most"), LIMITED_WRITERS)
@pytest.mark.one_in(56)
def test_what_runs_out_leaves_nothing_and_the_next_run_does_the_work(kind, limit, most, crossroads, made, tmp_path):
    shutil.copytree(crossroads, tmp_path / "copy")
    words, target = writers(tmp_path, crossroads, made)[kind]
    before = contents(tmp_path)
    line = [sys.executable, "-c", LIMITED, limit, str(most), COMMAND, *words]
    # Python would write the first bytes of a compiled module, and never start again
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(line, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 2), done.stderr
    if done.returncode == 2:
        assert done.stderr.count("error[") == 1
        assert "internal error" not in done.stderr
        left = {name: content for name, content in contents(tmp_path).items() if before.get(name) != content}
        assert kind == "resume" or not left, done.stderr
    assert outcome_after(words, target, dict(os.environ)) == "mended"
