"""Files that are there completely or not at all: written under another name, synced, then renamed."""

from __future__ import annotations

import errno
import os
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

try:
    import fcntl
except ImportError:
    fcntl = None

from scenicq.errors import DataError, Diagnostic

__all__ = [
    "Spare",
    "WholeFile",
    "made_folder",
    "sole_writer",
    "sync_folder",
    "whole_file",
    "whole_folder",
    "write_whole",
]


class WholeFile:
    """A file that gets its name when it is complete.

    What a reader finds under the name is what was there before or all of it, even if the machine stops. `whole_file`
    is the same as a `with` statement; this is for those who tell errors of the file from those of who writes it.
    """

    def __init__(self, path: Path, folder: Path | None = None) -> None:
        """Choose the names; nothing is written yet.

        Args:
            path: The file.
            folder: Where it is written, on the same file system; beside its place by default.
        """
        self._path = path
        self._temporary = (folder or path.parent) / f".{path.name}.{os.getpid()}.tmp"
        self._file: BinaryIO | None = None
        self._begun = False

    def open(self) -> BinaryIO:
        """The file, to be written.

        Raises:
            OSError: The folder cannot be written.
        """
        # an interrupt may come when the file is there and has not been handed on
        self._begun = True
        self._file = self._temporary.open("wb")
        return self._file

    def finish(self) -> None:
        """Give the file its name.

        Raises:
            OSError: What was written does not reach the disk.
        """
        assert self._file is not None
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()
        self._temporary.replace(self._path)
        sync_folder(self._path.parent)

    def abandon(self) -> None:
        """Remove what is not finished; nothing where all is."""
        if not self._begun:
            return
        if self._file is not None:
            with suppress(OSError):  # what is left in the buffer may not fit on the disk
                self._file.close()
        with suppress(OSError):
            self._temporary.unlink()


@contextmanager
def whole_file(path: Path) -> Generator[BinaryIO]:
    """A file to be written, which gets its name at the end of the block unless that fails.

    Raises:
        OSError: It cannot be written.
    """
    whole = WholeFile(path)
    try:
        yield whole.open()
        whole.finish()
    finally:
        whole.abandon()


def write_whole(path: Path, text: str) -> None:
    """Write a text file in UTF-8, completely or not at all.

    Raises:
        OSError: It cannot be written.
    """
    with whole_file(path) as file:
        file.write(text.encode())


@contextmanager
def made_folder(folder: Path) -> Generator[None]:
    """A folder, made if need be; if the block fails, one that was made and that nothing is in goes again.

    Raises:
        OSError: It cannot be made.
    """
    made = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        if made:
            with suppress(OSError):
                folder.rmdir()
        raise


@contextmanager
def whole_folder(path: Path) -> Generator[Path]:
    """A folder to be written, which gets its name at the end of the block unless that fails.

    Raises:
        OSError: It cannot be written; FileExistsError where something has the name.
        DataError: target-busy: another process writes it.
    """
    if os.path.lexists(path):
        raise FileExistsError
    beside = path.with_name(f".{path.name}.tmp")
    if beside.is_symlink():
        beside.unlink()
    with sole_writer(beside), Spare() as spare:
        try:
            _empty(beside)  # of what a process has left that was killed
            yield beside
            for file in (each for each in beside.rglob("*") if each.is_file()):
                with file.open("rb") as written:
                    os.fsync(written.fileno())
            beside.rename(path)
            sync_folder(path.parent)
        except BaseException as error:
            spare.close()
            with suppress(OSError):
                _empty(beside)
            if isinstance(error, UnicodeEncodeError):
                words = f"the system's encoding of names of files, {error.encoding}, has none for {error.object!a}"
                raise OSError(errno.EILSEQ, words) from error
            raise


def _empty(folder: Path) -> None:
    """Remove all that is in a folder, with one open folder at a time."""
    for path in sorted(folder.rglob("*"), reverse=True):
        if path.is_dir() and not path.is_symlink():
            path.rmdir()
        else:
            path.unlink()


class Spare:
    """An open file of no use, as a context manager: once it is closed, a folder can be listed however few may be open.

    Raises:
        OSError: Too many are open already.
    """

    def __init__(self) -> None:
        """Open it."""
        self._handle: int | None = os.open(os.devnull, os.O_RDONLY)

    def __enter__(self) -> Spare:
        """The file."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close it."""
        self.close()

    def close(self) -> None:
        """Close it, if it is open."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None


def _locked(handle: int) -> bool:
    """Lock a folder; also true where its file system has no locks."""
    try:
        if fcntl is not None:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True


@contextmanager
def sole_writer(folder: Path) -> Generator[None]:
    """Hold a folder for writing, made if need be, so that a second run is told before it works.

    The lock goes with the process, however that ends. A folder that was made and that nothing is in is removed again.

    Raises:
        DataError: target-busy: another process holds it; target-unwritable.
    """
    made = not folder.exists()
    try:
        with made_folder(folder):
            handle = None if fcntl is None else os.open(folder, os.O_RDONLY)
    except OSError as error:
        message = f"{folder} cannot be written: {error.strerror or error}"
        raise DataError(Diagnostic("target-unwritable", message)) from error
    try:
        if handle is not None and not _locked(handle):
            hint = "wait until it is done, or choose another target"
            raise DataError(Diagnostic("target-busy", f"another run writes to {folder}", hints=(hint,)))
        yield
    finally:
        if handle is not None:
            os.close(handle)
        if made:
            with suppress(OSError):
                folder.rmdir()


def sync_folder(folder: Path) -> None:
    """Make renames in a folder last, where the system can: some file systems have no such thing."""
    if os.name != "posix":
        return
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
