"""What every place does that files and folders are written to, on this machine or elsewhere."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from scenicq.store.atomic_files import COMPLETE, WholeFile, whole_file, whole_folder, write_whole
from scenicq.store.remote_path import AnyPath, any_path
from scenicq.store.targets import target_of


@pytest.fixture
def staged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where temporary folders are made: nothing is left there."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.fixture(params=["here", "elsewhere"])
def place(request: pytest.FixtureRequest, tmp_path: Path, staged: Path) -> Iterator[AnyPath]:
    """An empty folder to write in."""
    if request.param == "here":
        (tmp_path / "out").mkdir()
        yield tmp_path / "out"
    else:
        fsspec = pytest.importorskip("fsspec", reason="scenicq[remote] is not installed")
        files = fsspec.filesystem("memory")
        yield any_path("memory://out")
        if files.exists("/out"):
            files.rm("/out", recursive=True)
    assert not list(staged.iterdir())


def there(folder: AnyPath) -> dict[str, bytes]:
    """The files in a folder and in those within it."""
    found: dict[str, bytes] = {}
    for each in folder.iterdir():
        if each.is_dir():
            found |= {f"{each.name}/{name}": content for name, content in there(each).items()}
        else:
            found[each.name] = each.read_bytes()
    return found


def seen(folder: AnyPath) -> dict[str, bytes]:
    """What readers take for results: names that begin with a dot are those of work in progress."""
    return {name: content for name, content in there(folder).items() if not name.startswith(".")}


class StoppedError(Exception):
    pass


def stop_amid(write: Callable[[Any], object], content: object, error: type[BaseException]) -> None:
    write(content)
    raise error


def test_a_file_is_there_when_it_is_complete(place: AnyPath) -> None:
    file = place / "a b.txt"
    for content in ("first", "second"):
        before = seen(place)
        with whole_file(file) as written:
            written.write(content.encode())
            assert seen(place) == before
        assert there(place) == {"a b.txt": content.encode()}
    write_whole(file, "ä\n")
    assert there(place) == {"a b.txt": "ä\n".encode()}


@pytest.mark.parametrize("error", [StoppedError, KeyboardInterrupt])
def test_a_file_that_is_not_finished_leaves_what_was_there(place: AnyPath, error: type[BaseException]) -> None:
    write_whole(place / "a", "before")
    with pytest.raises(error), whole_file(place / "a") as written:
        stop_amid(written.write, b"after", error)
    assert there(place) == {"a": b"before"}


def test_a_file_is_abandoned_at_any_time(place: AnyPath) -> None:
    WholeFile(place / "a").abandon()
    begun, done = WholeFile(place / "a"), WholeFile(place / "b")
    begun.open()
    begun.abandon()
    done.open().write(b"1")
    done.finish()
    done.abandon()
    assert there(place) == {"b": b"1"}


@pytest.mark.parametrize("last", [COMPLETE, "index"])
def test_a_folder_is_there_when_it_is_complete(place: AnyPath, last: str) -> None:
    with whole_folder(place / "made", last) as work:
        (work / "below").mkdir()
        for name in ("index", "below/x"):
            (work / name).write_text(name)
        assert seen(place) == {}
    found = there(place)
    # a place that knows no folders says with a file of its own that all is there
    assert found.pop(f"made/{COMPLETE}", b"") == b""
    assert found == {"made/index": b"index", "made/below/x": b"below/x"}


@pytest.mark.parametrize("error", [StoppedError, KeyboardInterrupt])
def test_a_folder_that_is_not_finished_is_not_there(place: AnyPath, error: type[BaseException]) -> None:
    with pytest.raises(error), whole_folder(place / "made") as work:
        stop_amid((work / "x").write_text, "1", error)
    assert there(place) == {}
    with whole_folder(place / "made") as work:
        assert not list(work.iterdir())
        (work / "y").touch()
    assert "made/y" in there(place)


def test_what_is_there_is_no_place_for_a_folder(place: AnyPath) -> None:
    write_whole(place / "file", "1")
    with whole_folder(place / "made") as work:
        (work / "x").touch()
    before = there(place)
    for name in ("file", "made"):
        assert target_of(place / name).is_taken()
        with pytest.raises(FileExistsError), whole_folder(place / name):
            pytest.fail("nothing may be written there")
    assert not target_of(place / "neither").is_taken()
    assert there(place) == before


def test_a_folder_is_made_locked_and_removed_without_a_trace(place: AnyPath) -> None:
    target = target_of(place / "work")
    target.check_writable()
    with target.sole_writer():
        assert there(place) == {}
    assert not target.is_taken()
    with pytest.raises(StoppedError), target.made_folder():
        raise StoppedError
    assert not target.is_taken()
    with target.made_folder():
        write_whole(place / "work" / "piece", "1")
    assert there(place) == {"work/piece": b"1"}
    target.remove_folder()
    assert there(place) == {}
    target.remove_folder()


LEAVES = """
import os, sys
from pathlib import Path
from scenicq.store.atomic_files import WholeFile
whole = WholeFile(Path(sys.argv[1]))
whole.open().write(b"half")
print("writes", flush=True)
sys.stdin.readline() or os._exit(1)
"""


@pytest.mark.skipif(os.name == "nt", reason="locks of POSIX")
def test_what_a_dead_process_leaves_is_removed_by_the_next_and_nothing_else(tmp_path: Path) -> None:
    """Neither what a process still writes, nor what has a name that is alike."""
    for name in (".a.jsonl.tmp", ".a.jsonl.x.tmp", ".b.jsonl.7.tmp", "a.jsonl.7.tmp"):
        (tmp_path / name).write_text(name)
    alike = there(tmp_path)
    words = [sys.executable, "-c", LEAVES, str(tmp_path / "a.jsonl")]
    writers = [subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    for each in writers:
        assert each.stdout is not None
        assert each.stdout.readline() == "writes\n"
    dead, alive = writers
    dead.kill()
    dead.communicate()
    assert there(tmp_path).keys() - alike.keys() == {f".a.jsonl.{each.pid}.tmp" for each in writers}
    write_whole(tmp_path / "a.jsonl", "whole")
    assert there(tmp_path) == {**alike, "a.jsonl": b"whole", f".a.jsonl.{alive.pid}.tmp": b""}
    alive.kill()
    alive.communicate()
    write_whole(tmp_path / "a.jsonl", "again")
    assert there(tmp_path) == {**alike, "a.jsonl": b"again"}
