"""What Dask writes on the way lies in one folder of ours, and what the system does not give it is told."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from scenicq.store.read_lock import Reading

pytest.importorskip("distributed", reason="scenicq[dask] is not installed")

PROGRAM = Path(__file__).parents[4] / "sample_data" / "scenarios" / "02_crossing_cars.scenic"
WITHOUT_SHARED_MEMORY = 'umount -l /dev/shm; mount --bind /proc/self /dev/shm && exec "$@"'


def _run(command: Path, dataset: Path, folder: Path, *before: str) -> subprocess.CompletedProcess[str]:
    for name in ("here", "temporary"):
        (folder / name).mkdir(exist_ok=True)
    words = [
        str(command),
        "match",
        str(PROGRAM),
        str(dataset),
        "--engine",
        "dask",
        "--jobs",
        "2",
        "--limit",
        "1",
        "--exit-zero",
    ]
    environment = {**os.environ, "TMPDIR": str(folder / "temporary")}
    return subprocess.run(
        [*before, *words],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder / "here",
        env=environment,
        timeout=200,
    )


@pytest.mark.slow
def test_nothing_is_left_and_what_a_killed_run_has_left_goes(command: Path, crossroads: Path, tmp_path: Path) -> None:
    """A folder that was used a minute ago at least, and that nobody uses, is one that is left."""
    for name in ("left", "used", "new"):
        path = tmp_path / "temporary" / f"scenicq-dask-{name}"
        (path / "dask-scratch-space").mkdir(parents=True)
        if name != "new":
            os.utime(path, (1e9, 1e9))
    using = Reading(tmp_path / "temporary" / "scenicq-dask-used")
    done = _run(command, crossroads, tmp_path)
    using.end()
    assert (done.returncode, done.stderr) == (0, "")
    assert sorted(path.name for path in (tmp_path / "temporary").iterdir()) == ["scenicq-dask-new", "scenicq-dask-used"]
    assert not list((tmp_path / "here").iterdir())


@pytest.mark.skipif(
    sys.platform != "linux" or os.geteuid() != 0 or shutil.which("unshare") is None, reason="mounts are root's"
)
def test_without_shared_memory_it_is_said(command: Path, crossroads: Path, tmp_path: Path) -> None:
    before = ["unshare", "-m", "sh", "-c", WITHOUT_SHARED_MEMORY, "sh"]
    if subprocess.run([*before, "true"], capture_output=True, check=False).returncode:
        pytest.skip("nobody may mount here")
    done = _run(command, crossroads, tmp_path, *before)
    assert (done.returncode, done.stdout) == (2, "")
    first, *hints = done.stderr.splitlines()
    assert first.startswith("error[engine-failed]: Dask starts no processes here: ")
    assert all(line.startswith("  = hint: ") for line in hints)
    assert not list((tmp_path / "temporary").iterdir())
