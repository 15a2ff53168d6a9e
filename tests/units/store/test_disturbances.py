"""What a dataset goes through: readers while it is replaced, and disks that are full."""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from scenicq.importers.ingest import ingest
from scenicq.store.dataset import open_dataset

ROOT = Path(__file__).parents[3]
PROGRAM = ROOT / "sample_data" / "scenarios" / "01_pedestrian_facing_ego.scenic"
SEGMENT = 150
"""Small enough for several segments."""

pytestmark = pytest.mark.skipif(os.name != "posix", reason="locks and limits of POSIX")

READER = """
import json, sys, time
from pathlib import Path
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset

dataset, program, stop = sys.argv[1:]
options = QueryOptions(MatchOptions(tolerance=parse_tolerance("position=0.3,heading=5deg"), classes="coarse"))
while not Path(stop).exists():
    opened = open_dataset(dataset)
    found = [result.frame for result in Query(opened, read_program(program), options).results()]
    time.sleep(0.05)
    labels = [label.frame for label in opened.labels()]
    assert len(labels) == opened.manifest.total.frames
    print(json.dumps([len(labels), found]), flush=True)
"""


def recordings(source: Path, chosen: list[str]) -> None:
    """Leave only some recordings in a copy of the sample source."""
    lines = (ROOT / "sample_data" / "crossroads" / "labels.jsonl").read_text().splitlines(keepends=True)
    (source / "labels.jsonl").write_text("".join(line for line in lines if json.loads(line)["recording"] in chosen))


@pytest.fixture
def source(tmp_path: Path) -> Path:
    shutil.copytree(ROOT / "sample_data" / "crossroads", tmp_path / "source")
    return tmp_path / "source"


@pytest.mark.parametrize("updates", [2, pytest.param(40, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_readers_see_one_version_while_recordings_are_added(source: Path, tmp_path: Path, updates: int) -> None:
    names = sorted({json.loads(line)["recording"] for line in (source / "labels.jsonl").read_text().splitlines()})
    versions = [names[:3], names, names[2:]]
    expected: set[str] = set()
    for number, version in enumerate(versions):
        recordings(source, version)
        ingest(source, tmp_path / f"v{number}", segment_objects=SEGMENT)
        expected.add(read_once(tmp_path / f"v{number}", tmp_path))
    shutil.copytree(tmp_path / "v2", tmp_path / "d")
    stop = tmp_path / "stop"
    readers = [start_reader(tmp_path / "d", stop) for _ in range(2)]
    try:
        for reader in readers:
            assert reader.stdout is not None
            assert reader.stdout.readline() in expected
        for number in range(updates):
            recordings(source, versions[number % 3])
            ingest(source, tmp_path / "d", update=True, segment_objects=SEGMENT)
    finally:
        stop.touch()
        told = [reader.communicate() for reader in readers]
    for reader, (said, complaint) in zip(readers, told, strict=True):
        assert reader.returncode == 0, complaint
        assert set(said.splitlines(keepends=True)) <= expected
    recordings(source, versions[1])
    ingest(source, tmp_path / "d", update=True, segment_objects=SEGMENT)
    assert contents(tmp_path / "d") == contents(tmp_path / "v1")


def start_reader(dataset: Path, stop: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", READER, str(dataset), str(PROGRAM), str(stop)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def read_once(dataset: Path, folder: Path) -> str:
    """What a reader says of a dataset that nobody touches."""
    stop = folder / "once"
    reader = start_reader(dataset, stop)
    assert reader.stdout is not None
    line = reader.stdout.readline()
    stop.touch()
    reader.communicate()
    stop.unlink()
    return line


def contents(dataset: Path) -> dict[str, bytes]:
    found = {str(path.relative_to(dataset)): path.read_bytes() for path in dataset.rglob("*") if path.is_file()}
    manifest = json.loads(found["dataset.json"])
    del manifest["provenance"]
    return found | {"dataset.json": json.dumps(manifest).encode()}


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system with hardly any room."""
    place = tmp_path / "small"
    place.mkdir()
    mount, unmount = shutil.which("mount"), shutil.which("umount")
    command = [str(mount), "-t", "tmpfs", "-o", "size=300k", "scenicq-test", str(place)]
    if mount is None or unmount is None or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("mounting a small file system needs root")
    yield place
    subprocess.run([unmount, str(place)], check=True)


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_full_disk(small_disk: Path, source: Path, run, jobs: int) -> None:
    names = sorted({json.loads(line)["recording"] for line in (ROOT / "sample_data/crossroads/labels.jsonl").open()})
    recordings(source, names[:1])
    assert run("ingest", source, small_disk / "d", "-q").exit_code == 0
    before = contents(small_disk / "d")
    recordings(source, names)
    with (small_disk / "filler").open("wb") as filler:
        room = os.statvfs(small_disk)
        filler.write(b"x" * (room.f_bavail * room.f_frsize - 20_000))
    for how in ("--force", "--update"):
        failed = run("ingest", source, small_disk / "d", how, "--jobs", jobs)
        assert (failed.exit_code, failed.stderr.count("error[")) == (2, 1), failed.output
        assert failed.stderr.startswith("error[target-unwritable]: ")
        assert "No space left on device" in failed.stderr
        assert contents(small_disk / "d") == before
        assert sorted(path.name for path in small_disk.iterdir()) == ["d", "filler"]
    open_dataset(small_disk / "d").verify()
    (small_disk / "filler").open("ab").write(b"x" * 15_000)
    for extra in ((), ("--resume",)):
        failed = run("match", PROGRAM, small_disk / "d", "--all", "-o", small_disk / "found.jsonl", *extra)
        assert (failed.exit_code, failed.stderr.count("error[")) == (2, 1), failed.stderr
        assert failed.stderr.startswith("error[target-unwritable]: ")
        assert not (small_disk / "found.jsonl").exists()


LIMITED = """
import resource, sys
from scenicq_cli.main import main
if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv.pop(1)), resource.RLIM_INFINITY))
    main()
"""


@pytest.mark.parametrize("limit", [4_000, 12_000])
def test_a_file_that_may_not_grow(source: Path, tmp_path: Path, limit: int) -> None:
    ingest(source, tmp_path / "d")
    before = contents(tmp_path / "d")
    sizes = sorted(len(content) for content in before.values())
    assert sizes[0] < limit < sizes[-1]
    (tmp_path / "limited.py").write_text(LIMITED)
    command = [sys.executable, str(tmp_path / "limited.py"), str(limit), "ingest", str(source), str(tmp_path / "d")]
    # Python would write the first bytes of a compiled module, and never start again
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    failed = subprocess.run([*command, "--force"], env=environment, capture_output=True, text=True, check=False)
    assert (failed.returncode, failed.stdout) == (2, "")
    assert failed.stderr.startswith("error[target-unwritable]: ")
    assert "File too large" in failed.stderr
    assert contents(tmp_path / "d") == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["d", "limited.py", "source"]
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] == resource.RLIM_INFINITY
