"""Write files and folders so that they are complete or not there, on this machine or elsewhere (`RemotePath`).

Here they are written under another name, synced, then renamed. Elsewhere they are written in a folder of this machine
and then sent: a file appears at once, and the last file of a folder when all others are there.
"""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

try:
    import fcntl
except ImportError:
    fcntl = None

from scenicq.errors import DataError, Diagnostic
from scenicq.store.remote_path import AnyPath, RemotePath

__all__ = [
    "COMPLETE",
    "Spare",
    "WholeFile",
    "check_writable",
    "is_taken",
    "made_folder",
    "remove_folder",
    "sole_writer",
    "sync_folder",
    "whole_file",
    "whole_folder",
    "write_whole",
]

COMPLETE = "_SUCCESS"
"""The empty file that comes last into a folder elsewhere, as jobs of Hadoop and Spark leave it."""
_STAGE = "scenicq-"
"""How the temporary folders begin in which lies what is to be sent."""


class WholeFile:
    """A file that gets its name when it is complete.

    Under the name a reader finds what was there before, or the complete file, even if the machine stops. `whole_file`
    does the same in a `with` statement; this class tells errors of the file from errors of its writer.
    """

    def __init__(self, path: AnyPath, folder: AnyPath | None = None) -> None:
        """Choose the names; nothing is written yet.

        Args:
            path: The file.
            folder: Where a file of this machine is written, on the same file system; beside its place by default.
        """
        self._path = path
        self._stage: Path | None = None
        beside = folder if isinstance(folder, Path) else path.parent if isinstance(path, Path) else Path()
        self._temporary = beside / f".{path.name}.{os.getpid()}.tmp"
        self._file: BinaryIO | None = None
        self._begun = False

    def open(self) -> BinaryIO:
        """The file, to be written.

        Raises:
            OSError: The folder cannot be written.
        """
        # an interrupt may come when the file is there and has not been handed on
        self._begun = True
        if isinstance(self._path, RemotePath):
            self._stage = Path(tempfile.mkdtemp(prefix=_STAGE))
            self._temporary = self._stage / self._path.name
        self._file = self._temporary.open("wb")
        return self._file

    def finish(self) -> None:
        """Give the file its name.

        Raises:
            OSError: What was written does not reach the disk.
            DataError: target-unwritable: it cannot be sent; it stays on this machine, and is named.
        """
        assert self._file is not None
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()
        if isinstance(self._path, RemotePath):
            try:
                self._path.put(self._temporary)
            except DataError as error:
                self._stage = None
                raise _staying(error, self._temporary) from error
        else:
            self._temporary.replace(self._path)
            sync_folder(self._path.parent)

    def abandon(self) -> None:
        """Remove what is not finished; nothing where all is."""
        if not self._begun:
            return
        if self._file is not None:
            with suppress(OSError):  # what is left in the buffer may not fit on the disk
                self._file.close()
        if isinstance(self._path, RemotePath):
            if self._stage is not None:
                shutil.rmtree(self._stage, ignore_errors=True)
            return
        with suppress(OSError):
            self._temporary.unlink()


def _staying(error: DataError, stage: Path) -> DataError:
    """Add to an error where on this machine the file lies that could not be sent."""
    (told,) = error.diagnostics
    hint = f"what was to be written lies in {stage}, and can be copied there"
    return DataError(replace(told, hints=(*told.hints, hint)))


@contextmanager
def whole_file(path: AnyPath) -> Generator[BinaryIO]:
    """Open a file for writing; it gets its name at the end of the block, unless the block fails.

    Raises:
        OSError: It cannot be written.
        DataError: target-unwritable: it cannot be sent.
    """
    whole = WholeFile(path)
    try:
        yield whole.open()
        whole.finish()
    finally:
        whole.abandon()


def write_whole(path: AnyPath, text: str) -> None:
    """Write a text file in UTF-8, completely or not at all.

    Raises:
        OSError, DataError: It cannot be written; as of `whole_file`.
    """
    with whole_file(path) as file:
        file.write(text.encode())


def is_taken(path: AnyPath) -> bool:
    """Whether anything has the name, a link that leads nowhere included.

    Raises:
        DataError: store-unreachable.
    """
    return path.exists() if isinstance(path, RemotePath) else os.path.lexists(path)


def check_writable(path: AnyPath) -> None:
    """Check before the work that a place elsewhere can be written; on this machine, opening a file tells.

    Raises:
        DataError: target-unwritable.
    """
    if isinstance(path, RemotePath):
        path.check_writable()


@contextmanager
def made_folder(folder: AnyPath) -> Generator[None]:
    """Make a folder where there is none; if the block fails, an empty one that was made is removed.

    Elsewhere there are no folders but by what is in them.

    Raises:
        OSError: It cannot be made.
    """
    if isinstance(folder, RemotePath):
        yield
        return
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
def whole_folder(path: AnyPath, last: str = COMPLETE) -> Generator[Path]:
    """Make a folder to write in; it gets its name at the end of the block, unless the block fails.

    Args:
        path: Where it shall be; nothing may be there.
        last: Name of the file that is sent last where the folder is elsewhere; one that is not there is made, empty.

    Raises:
        OSError: It cannot be written; FileExistsError where something has the name.
        DataError: target-busy: another process writes it; target-unwritable: it cannot be sent.
    """
    if isinstance(path, RemotePath):
        if is_taken(path):
            raise FileExistsError
        with _sent_folder(path, last) as folder:
            yield folder
        return
    if is_taken(path):
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


@contextmanager
def _sent_folder(path: RemotePath, last: str) -> Generator[Path]:
    """Make a folder on this machine, and send it at the end of the block, unless the block fails."""
    stage = Path(tempfile.mkdtemp(prefix=_STAGE))
    keep = False
    try:
        folder = stage / path.name
        folder.mkdir()
        yield folder
        names = sorted(each.relative_to(folder) for each in folder.rglob("*") if each.is_file())
        if Path(last) in names:
            names.remove(Path(last))
        else:
            (folder / last).touch()
        sent: list[RemotePath] = []
        try:
            for name in (*names, Path(last)):
                sent.append(path / name)
                sent[-1].put(folder / name)
        except BaseException as error:
            for each in reversed(sent):
                each.remove()
            if isinstance(error, DataError):
                keep = True
                raise _staying(error, folder) from error
            raise
    finally:
        if not keep:
            shutil.rmtree(stage, ignore_errors=True)


def remove_folder(folder: AnyPath) -> None:
    """Remove a folder with all in it, as far as that may be."""
    if isinstance(folder, RemotePath):
        folder.remove_folder()
    else:
        shutil.rmtree(folder, ignore_errors=True)


def _empty(folder: Path) -> None:
    """Remove all that is in a folder, with one open folder at a time."""
    for path in sorted(folder.rglob("*"), reverse=True):
        if path.is_dir() and not path.is_symlink():
            path.rmdir()
        else:
            path.unlink()


class Spare:
    """A file kept open in reserve: closing it lets a folder be listed where no more files may be opened.

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
    """Lock a folder, and say whether it is locked; True also where its file system has no locks."""
    try:
        if fcntl is not None:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True


@contextmanager
def sole_writer(folder: AnyPath) -> Generator[None]:
    """Lock a folder for writing, and make it if need be, so that a second run fails before its work.

    The lock goes with the process, however that ends. A folder that was made and that nothing is in is removed again.
    Elsewhere there are no locks.

    Raises:
        DataError: target-busy: another process holds it; target-unwritable.
    """
    if isinstance(folder, RemotePath):
        yield
        return
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
    """Make renames in a folder survive a stop of the machine, where the file system can."""
    if os.name != "posix":
        return
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
