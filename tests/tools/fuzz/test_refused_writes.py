"""Every step of a writer refused in turn, and disks that are full after so many bytes: whole files or none.

What is refused is told in one line; nothing is left of it, what was there before is as it was, and the next run works.
"""

from __future__ import annotations

import errno
import os
import re
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from kills import COMMAND, prepare, writers

import scenicq
from scenicq.errors import ScenicqError
from scenicq.store import atomic_files

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits are those of Linux")

KINDS = tuple(kind for kind in writers(Path(), Path(), Path()) if kind != "resume")
"""What `--resume` keeps of a run that ends is no leftover."""
SIZES = (0, 1, 100, 1000, 4096, 8192, 20_000, 65_536)
_OPENED_TO_WRITE = os.O_WRONLY | os.O_RDWR
STEPS = {"os.mkdir", "os.rename", "os.link", "os.symlink", "os.truncate"}


class Refusals:
    """Refuses one of the steps that change something below a folder: opening to write, writing, renaming, ..."""

    def __init__(self) -> None:
        """Refuse nothing."""
        self.folder = ""
        self.taken, self.refused = 0, -1
        sys.addaudithook(self._hook)

    def _hook(self, event: str, args: tuple[Any, ...]) -> None:
        if not self.folder:
            return
        if event == "open" and not (isinstance(args[2], int) and args[2] & _OPENED_TO_WRITE):
            return
        if (event == "open" or event in STEPS) and str(args[0]).startswith(self.folder):
            self.step()

    def step(self) -> None:
        """One more step, which may be the one that is refused."""
        if self.folder:
            self.taken += 1
            if self.taken == self.refused:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    @contextmanager
    def below(self, folder: Path, number: int) -> Iterator[None]:
        """Refuse the step of a number within the block."""
        self.folder, self.taken, self.refused = str(folder), 0, number
        try:
            yield
        finally:
            self.folder = ""


class Full:
    """A file each write to which is a step."""

    def __init__(self, file: Any, step: Callable[[], None]) -> None:
        """Take the file."""
        self._file, self._step = file, step

    def write(self, data: bytes) -> int:
        self._step()
        return self._file.write(data)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


@pytest.fixture(scope="module")
def refusals() -> Refusals:
    return Refusals()


@pytest.fixture(scope="module")
def made(crossroads: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("before") / "made"
    prepare(folder, crossroads)
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    """Every file and folder."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else b"" for path in folder.rglob("*")
    }


def check(done: Any, before: dict[str, bytes], work: Path, what: object) -> bool:
    """Whether a command was refused something, which it has told, leaving nothing."""
    if done.exit_code == 0:
        return False
    told = done.stderr
    assert (done.exit_code, told.count("error[")) == (2, 1), (what, told, done.exception)
    assert "internal error" not in told, (what, told)
    left = {name for name, content in contents(work).items() if before.get(name) != content}
    # the note of the question that a folder is for is whole before the piece, and other shards may read it
    noted = {name for name in left if re.fullmatch(r"pieces(/\w+\.json)?", name)}
    assert left == noted, (what, told)
    assert before.keys() <= contents(work).keys()
    return True


def work_folder(tmp_path: Path, kind: str, crossroads: Path) -> Path:
    work = tmp_path / "work"
    work.mkdir()
    if kind == "index":
        shutil.copytree(crossroads, work / "copy")
    return work


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.one_in(20)
@pytest.mark.timeout(1800)
def test_any_step_may_be_refused(kind, run, refusals, crossroads, made, tmp_path, monkeypatch):
    """The n-th, for each n until there is none."""
    opened = atomic_files.open_staged
    monkeypatch.setattr(atomic_files, "open_staged", lambda staged: Full(opened(staged), refusals.step))
    work = work_folder(tmp_path, kind, crossroads)
    words, target = writers(work, crossroads, made)[kind]
    before = contents(work)
    for number in range(1, 1000):
        with refusals.below(work, number):
            done = run(*words)
        if check(done, before, work, number):
            continue
        assert target.exists()
        assert not [name for name in contents(work) if name.startswith(".")]
        if refusals.taken < number:
            break
        # what was refused it can go without
        shutil.rmtree(work)
        assert contents(work_folder(tmp_path, kind, crossroads)) == before
    assert number > 1


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Let no file of this process become larger in the block."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.one_in(10)
def test_a_file_may_be_cut_anywhere(kind, run, crossroads, made, tmp_path):
    work = work_folder(tmp_path, kind, crossroads)
    words, target = writers(work, crossroads, made)[kind]
    before = contents(work)
    for size in SIZES:
        with largest_file(size):
            done = run(*words)
        if not check(done, before, work, size):
            break
    else:
        assert run(*words).exit_code == 0
    assert target.exists()


PRINTERS = {
    "picture": ["show", "TOWN", "03-busy-intersection/09"],
    "figures": ["evaluate", "MADE/found.jsonl", "TOWN", "--predictions", "MADE/predictions.jsonl", "--format", "json"],
    "matches": ["match", "PROGRAM", "TOWN", "--format", "jsonl"],
    "table": ["match", "PROGRAM", "TOWN", "--format", "parquet"],
    "gathered": ["gather", "MADE/pieces"],
    "help": ["match", "--help"],
}


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("kind", PRINTERS)
@pytest.mark.one_in(12)
def test_what_is_printed_is_whole_or_told(kind, unbuffered, crossroads, made, tmp_path):
    """The system takes a part of what is written, and says so: PYTHONUNBUFFERED has Python hand that on."""
    from kills import PROGRAM

    named = {"TOWN": str(crossroads), "PROGRAM": PROGRAM}
    words = [COMMAND, *(named.get(word, word).replace("MADE", str(made)) for word in PRINTERS[kind])]
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered, "PYTHONDONTWRITEBYTECODE": "1"}
    whole = subprocess.run(words, env=environment, capture_output=True, check=False)
    assert whole.returncode in (0, 1), whole.stderr
    for size in (0, 512, 4096, len(whole.stdout)):
        limited = f"import os, resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, ({size},) * 2); "
        line = [sys.executable, "-c", limited + "os.execv(sys.argv[1], sys.argv[1:])", *words]
        with (tmp_path / "printed").open("wb") as file:
            done = subprocess.run(line, env=environment, stdout=file, stderr=subprocess.PIPE, check=False, text=True)
        printed = (tmp_path / "printed").read_bytes()
        if size < len(whole.stdout):
            assert done.returncode == 2, (size, done.stderr)
            assert "error[target-unwritable]: standard output cannot be written" in done.stderr
            assert len(printed) <= size
        else:
            assert (done.returncode, len(printed)) == (whole.returncode, len(whole.stdout))


def test_a_picture_is_saved_whole_or_not(refusals, crossroads, tmp_path, monkeypatch):
    opened = atomic_files.open_staged
    monkeypatch.setattr(atomic_files, "open_staged", lambda staged: Full(opened(staged), refusals.step))
    picture = next(iter(scenicq.open(crossroads))).show()
    (tmp_path / "frame.svg").write_text("before")
    told: set[str] = set()
    for number in range(1, 100):
        try:
            with refusals.below(tmp_path, number):
                picture.save(tmp_path / "frame.svg")
        except ScenicqError as error:
            told.add(error.diagnostics[0].code)
            assert contents(tmp_path) == {"frame.svg": b"before"}
        else:
            break
    assert told == {"target-unwritable"}
    assert number > 3
    for size in SIZES:
        (tmp_path / "frame.svg").write_text("before")
        try:
            with largest_file(size):
                picture.save(tmp_path / "frame.svg")
        except ScenicqError:
            assert contents(tmp_path) == {"frame.svg": b"before"}
    assert (tmp_path / "frame.svg").read_text().startswith("<svg")


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Callable[[int], Path]]:
    """What makes a disk of so many bytes; where that may not be, the test is skipped."""
    folders: list[Path] = []

    def of(size: int) -> Path:
        folder = tmp_path / f"disk-{size}"
        folder.mkdir()
        words = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
        if shutil.which("mount") is None or subprocess.run(words, capture_output=True, check=False).returncode:
            pytest.skip("no disk can be mounted")
        folders.append(folder)
        return folder

    yield of
    for folder in folders:
        subprocess.run(["umount", str(folder)], check=False)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.slow
def test_a_full_disk_leaves_nothing(kind, run, small_disk, crossroads, made):
    """The work has a disk of its own, of 4 to 128 kB beside what is there before."""
    for size in (4096, 16_384, 131_072):
        there = sum(each.stat().st_size for each in crossroads.rglob("*") if each.is_file()) if kind == "index" else 0
        disk = small_disk(size + there + (300_000 if there else 0))
        work = work_folder(disk, kind, crossroads)
        words, target = writers(work, crossroads, made)[kind]
        before = contents(work)
        if check(run(*words), before, work, size):
            continue
        assert target.exists()
        return
