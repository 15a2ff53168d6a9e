"""Places that files and folders are written to, on this machine or elsewhere: one protocol, and what each does for it.

Here what is written has another name until it is complete, is synced, and is then renamed; a lock keeps a second writer
away. Elsewhere it is written in a folder of this machine and then sent: a file appears at once, and the last file of a
folder when all others are there; there are no locks, and no folders but by what is in them.
"""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Generator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO, Protocol

try:
    import fcntl
except ImportError:
    fcntl = None

from scenicq.errors import DataError, Diagnostic
from scenicq.store.remote_path import AnyPath, RemotePath

__all__ = ["ReserveFile", "WriteTarget", "open_staged", "sync_folder", "target_of"]

_STAGE = "scenicq-"
"""How the temporary folders begin in which lies what is to be sent."""


class WriteTarget(Protocol):
    """A place that a file or a folder is written to."""

    def is_taken(self) -> bool:
        """Whether anything has the name, a link that leads nowhere included.

        Raises:
            DataError: store-unreachable.
        """
        ...

    def check_writable(self) -> None:
        """Check before the work that it can be written, where opening a file does not tell.

        Raises:
            DataError: target-unwritable.
        """
        ...

    def stage_file(self, folder: Path | None) -> Path:
        """Where the file is written until it is complete.

        Args:
            folder: Where a file of this machine is written, on the same file system; beside its place by default.

        Raises:
            OSError: There is no place for it.
        """
        ...

    def publish_file(self, staged: Path) -> None:
        """Give a complete file its name.

        Raises:
            OSError: It cannot be renamed.
            DataError: target-unwritable: it cannot be sent; it stays where it was written, and is named.
        """
        ...

    def discard_file(self, staged: Path) -> None:
        """Remove what is left of a file that was written; nothing where nothing is."""
        ...

    def new_folder(self, last: str) -> AbstractContextManager[Path]:
        """Make a folder to write in; it gets its name at the end of the block, unless the block fails.

        Args:
            last: Name of the file that is sent last; one that is not there is made, empty.

        Raises:
            OSError: It cannot be written.
            DataError: target-busy: another process writes it; target-unwritable: it cannot be sent.
        """
        ...

    def made_folder(self) -> AbstractContextManager[None]:
        """Make a folder where there is none; if the block fails, an empty one that was made is removed.

        Raises:
            OSError: It cannot be made.
        """
        ...

    def sole_writer(self) -> AbstractContextManager[None]:
        """Lock a folder for writing, and make it if need be, so that a second run fails before its work.

        The lock goes with the process, however that ends. A folder that was made and that nothing is in is removed
        again.

        Raises:
            DataError: target-busy: another process holds it; target-unwritable.
        """
        ...

    def remove_folder(self) -> None:
        """Remove a folder with all in it, as far as that may be."""
        ...


def target_of(path: AnyPath) -> WriteTarget:
    """The target that a path of this machine is, or a place elsewhere."""
    return _Sent(path) if isinstance(path, RemotePath) else _Renamed(path)


@dataclass(frozen=True, slots=True)
class _Renamed:
    """A place on this machine."""

    path: Path

    def is_taken(self) -> bool:
        return os.path.lexists(self.path)

    def check_writable(self) -> None:
        pass

    def stage_file(self, folder: Path | None) -> Path:
        folder = folder or self.path.parent
        _remove_left(folder, f".{self.path.name}.", ".tmp")
        return folder / f".{self.path.name}.{os.getpid()}.tmp"

    def publish_file(self, staged: Path) -> None:
        staged.replace(self.path)
        sync_folder(self.path.parent)

    def discard_file(self, staged: Path) -> None:
        with suppress(OSError):
            staged.unlink()

    @contextmanager
    def new_folder(self, last: str) -> Generator[Path]:
        beside = self.path.with_name(f".{self.path.name}.tmp")
        if beside.is_symlink():
            beside.unlink()
        with _Renamed(beside).sole_writer(), ReserveFile() as spare:
            try:
                _empty(beside)  # of what a process has left that was killed
                yield beside
                for file in (each for each in beside.rglob("*") if each.is_file()):
                    with file.open("rb") as written:
                        os.fsync(written.fileno())
                beside.rename(self.path)
                sync_folder(self.path.parent)
            except BaseException as error:
                spare.close()
                with suppress(OSError):
                    _empty(beside)
                if isinstance(error, UnicodeEncodeError):
                    words = f"the system's encoding of names of files, {error.encoding}, has none for {error.object!a}"
                    raise OSError(errno.EILSEQ, words) from error
                raise

    @contextmanager
    def made_folder(self) -> Generator[None]:
        made = not self.path.exists()
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            yield
        except BaseException:
            if made:
                with suppress(OSError):
                    self.path.rmdir()
            raise

    @contextmanager
    def sole_writer(self) -> Generator[None]:
        made = not self.path.exists()
        try:
            with self.made_folder():
                handle = None if fcntl is None else os.open(self.path, os.O_RDONLY)
        except OSError as error:
            message = f"{self.path} cannot be written: {error.strerror or error}"
            raise DataError(Diagnostic("target-unwritable", message)) from error
        try:
            if handle is not None and not _locked(handle):
                hint = "wait until it is done, or choose another target"
                raise DataError(Diagnostic("target-busy", f"another run writes to {self.path}", hints=(hint,)))
            yield
        finally:
            if handle is not None:
                os.close(handle)
            if made:
                with suppress(OSError):
                    self.path.rmdir()

    def remove_folder(self) -> None:
        shutil.rmtree(self.path, ignore_errors=True)


@dataclass(frozen=True, slots=True)
class _Sent:
    """A place elsewhere."""

    path: RemotePath

    def is_taken(self) -> bool:
        return self.path.exists()

    def check_writable(self) -> None:
        self.path.check_writable()

    def stage_file(self, folder: Path | None) -> Path:
        return Path(tempfile.mkdtemp(prefix=_STAGE)) / self.path.name

    def publish_file(self, staged: Path) -> None:
        try:
            self.path.put(staged)
        except DataError as error:
            raise _staying(error, staged) from error

    def discard_file(self, staged: Path) -> None:
        shutil.rmtree(staged.parent, ignore_errors=True)

    @contextmanager
    def new_folder(self, last: str) -> Generator[Path]:
        stage = Path(tempfile.mkdtemp(prefix=_STAGE))
        keep = False
        try:
            folder = stage / self.path.name
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
                    sent.append(self.path / name)
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

    @contextmanager
    def made_folder(self) -> Generator[None]:
        yield

    @contextmanager
    def sole_writer(self) -> Generator[None]:
        yield

    def remove_folder(self) -> None:
        self.path.remove_folder()


def _staying(error: DataError, stage: Path) -> DataError:
    """Add to an error where on this machine the file lies that could not be sent."""
    (told,) = error.diagnostics
    hint = f"what was to be written lies in {stage}, and can be copied there"
    return DataError(replace(told, hints=(*told.hints, hint)))


def _empty(folder: Path) -> None:
    """Remove all that is in a folder, with one open folder at a time."""
    for path in sorted(folder.rglob("*"), reverse=True):
        if path.is_dir() and not path.is_symlink():
            path.rmdir()
        else:
            path.unlink()


def open_staged(staged: Path) -> BinaryIO:
    """Open a file for writing that is locked until it is closed or its process is dead.

    Raises:
        OSError: It cannot be written.
    """
    while True:
        file = staged.open("wb")
        _locked(file.fileno())
        # before it was locked, another process may have taken it for one that is left
        with suppress(FileNotFoundError):
            if fcntl is None or os.path.samestat(staged.stat(), os.fstat(file.fileno())):
                return file
        file.close()


def _remove_left(folder: Path, begin: str, end: str) -> None:
    """Remove files with a number between a beginning and an end of their names that no process holds any more.

    They are of processes that were killed. Where nothing says that a file is held by nobody, it stays.
    """
    with suppress(OSError):
        for name in os.listdir(folder):
            if not (name.startswith(begin) and name.endswith(end) and name[len(begin) : -len(end)].isdecimal()):
                continue
            with suppress(OSError):
                handle = os.open(folder / name, os.O_RDONLY)
                try:
                    if fcntl is not None:
                        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                        os.unlink(folder / name)
                finally:
                    os.close(handle)


def _locked(handle: int) -> bool:
    """Lock a folder or a file, and say whether it is locked; True also where its file system has no locks."""
    try:
        if fcntl is not None:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True


class ReserveFile:
    """A file kept open in reserve: closing it lets a folder be listed where no more files may be opened.

    Raises:
        OSError: Too many are open already.
    """

    def __init__(self) -> None:
        """Open it."""
        self._handle: int | None = os.open(os.devnull, os.O_RDONLY)

    def __enter__(self) -> ReserveFile:
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
