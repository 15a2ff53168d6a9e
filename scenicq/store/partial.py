"""The hidden folder in which an ingest writes a dataset before it takes the target's name.

The folder `.NAME.partial` belongs to the process that holds its lock; the system releases the lock when the process
ends. After a hard kill the folder stays, with the segments that are complete, and the next ingest of that target goes
on from there.

If the target is a dataset already, the new files move into it beside the old ones, which have other names. Then the
new manifest replaces the old one in one step. Files that it does not name are removed as soon as nobody reads the
dataset, or by the next ingest.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO

from scenicq.errors import DataError, Diagnostic
from scenicq.store.manifest import FOLDERS, check_path, find_links, is_dataset
from scenicq.store.read_lock import nobody_reads
from scenicq.store.targets import ReserveFile, sync_folder

try:
    import fcntl
except ImportError:  # not POSIX: two ingests into one target are then the user's to avoid
    fcntl = None

__all__ = ["Partial", "check_target"]

_LOCK = "lock"
_SCHEME = re.compile("[A-Za-z][A-Za-z0-9+.-]+:")
"""How an address begins that was taken for a path; one letter is a drive."""


class Partial:
    """The folder of a dataset that is not finished, held by a lock."""

    def __init__(self, target: Path) -> None:
        """Take the folder of the dataset to be; nothing happens on the disk yet."""
        self.target = Path(os.path.realpath(target))
        self.folder = self.target.with_name(f".{self.target.name}.partial")
        self._kept: list[Path] = []
        self._lock: IO[bytes] | None = None
        self._spare: ReserveFile | None = None

    def open(self) -> None:
        """Make the folder, or take over one that a killed process left, and lock it.

        Raises:
            OSError: The place cannot be written.
            DataError: `target-exists` while another process writes there; `target-unwritable` where it is a link.
        """
        if self.folder.is_symlink():
            raise _link_error(self.target, self.folder)
        self._spare = ReserveFile()
        try:
            while self._lock is None:
                self.folder.mkdir(exist_ok=True)
                self._lock = self._take_lock()
            for link in find_links(self.folder):
                link.unlink()  # what an earlier process left there is not ours to go on from
        except BaseException:
            self._abandon()
            raise

    def _take_lock(self) -> IO[bytes] | None:
        """Lock the folder; None if it was finished and renamed meanwhile."""
        path = self.folder / _LOCK
        file = path.open("wb")
        try:
            if fcntl is not None:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                # Whoever held the lock before may have finished meanwhile, and the folder with it.
                if not path.exists() or path.stat().st_ino != os.fstat(file.fileno()).st_ino:
                    file.close()
                    return None
            return file  # inside the try: an interrupt that comes here must close the file, too
        except BlockingIOError as error:
            file.close()
            message = f"another ingest is writing {self.target}"
            raise DataError(Diagnostic("target-exists", message, hints=("wait until it ends",))) from error
        except BaseException:
            file.close()  # a traceback would keep the file open, and the lock with it
            raise

    def _abandon(self) -> None:
        """Remove the folder if it is empty and no other process holds it."""
        self._free_spare()
        with suppress(OSError, DataError):
            self._lock = self._lock or self._take_lock()
            if self._lock is not None:
                (self.folder / _LOCK).unlink()
                self.folder.rmdir()
        self._unlock()

    def clear(self) -> None:
        """Remove what an earlier process left in the folder."""
        for path in self.folder.iterdir():
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            elif path.name != _LOCK:
                path.unlink()

    def remove(self) -> None:
        """Remove the folder, if it is ours."""
        if self._lock is not None:
            if fcntl is None:
                self._unlock()
            self._free_spare()
            with suppress(OSError):
                _remove_others(self.folder, {Path(_LOCK)})  # one open folder at a time
                (self.folder / _LOCK).unlink(missing_ok=True)
                self.folder.rmdir()
            self._unlock()

    def keep(self, files: Sequence[Path]) -> None:
        """Remove everything but some files.

        Args:
            files: Relative to the folder; the manifest last.

        Raises:
            OSError: The folder cannot be written.
        """
        self._kept = list(files)
        _remove_others(self.folder, {*files, Path(_LOCK)})

    def put_in_place(self) -> None:
        """Give the folder the target's name, or its files to the dataset that is there.

        Raises:
            OSError: The place cannot be written.
        """
        if os.path.lexists(self.target):
            self._hand_over()
        else:
            if fcntl is None:
                self._unlock()  # elsewhere a folder with an open file cannot be renamed
            self.folder.rename(self.target)
            (self.target / _LOCK).unlink(missing_ok=True)
            self._unlock()
            sync_folder(self.target.parent)

    def _hand_over(self) -> None:
        """Move the files into the dataset that is there, the manifest last."""
        folders = sorted({path.parent for path in self._kept})
        for name in folders:
            (self.target / name).mkdir(exist_ok=True)
        *files, manifest = self._kept
        for file in files:
            (self.folder / file).replace(self.target / file)
        for name in folders:
            sync_folder(self.target / name)
        (self.folder / manifest).replace(self.target / manifest)
        sync_folder(self.target)
        # the new dataset is complete: what fails from here on is left for the next ingest
        with suppress(OSError), nobody_reads(self.target) as free:
            if free:
                for name in FOLDERS:
                    _remove_others(self.target, set(self._kept), name)
        self.remove()

    def _free_spare(self) -> None:
        if self._spare is not None:
            self._spare.close()

    def _unlock(self) -> None:
        self._free_spare()
        if self._lock is not None:
            self._lock.close()
            self._lock = None


def _link_error(target: Path, link: Path) -> DataError:
    message = f"{target} cannot be written: {link} is a link, and nothing is written or removed through one"
    return DataError(Diagnostic("target-unwritable", message, hints=("put a folder in its place, or remove it",)))


def _remove_others(folder: Path, files: set[Path], below: str = "") -> None:
    """Remove all files of a folder, or of one below it, except for some, which are relative to the folder."""
    for path in sorted((folder / below).rglob("*"), reverse=True):
        if path.is_dir() and not path.is_symlink():
            with suppress(OSError):
                path.rmdir()
        elif path.relative_to(folder) not in files:
            path.unlink()


def check_target(target: Path, *, force: bool = False, update: bool = False) -> None:
    """Refuse a target that must not be written.

    Args:
        target: Folder of the dataset to be.
        force: Whether a dataset that is there already may be replaced.
        update: Whether it may be brought up to date.

    Raises:
        DataError: `target-exists`; `target-unwritable` for a path without a name of its own, one that is no text, or
            one of whose folders is a link.
    """
    if _SCHEME.fullmatch(target.parts[0] if target.parts else ""):
        message = f"{target} begins as an address does, and is no folder of this machine"
        hint = "`scenicq ingest SOURCE s3://...` writes a dataset elsewhere"
        raise DataError(Diagnostic("target-unwritable", message, hints=(hint,)))
    if not target.name or target.name == "..":
        raise DataError(Diagnostic("target-unwritable", f"{target} is not the name of a new folder"))
    check_path(target, "target-unwritable")
    if not os.path.lexists(target):
        return
    if not is_dataset(target):
        hint = "choose another name: only a dataset can be replaced"
        raise DataError(Diagnostic("target-exists", f"{target} exists and is not a dataset of scenicq", hints=(hint,)))
    if not force and not update:
        hints = ("`--force` replaces it", "`--update` adds what is new in the source")
        raise DataError(Diagnostic("target-exists", f"the dataset {target} exists", hints=hints))
    for link in find_links(target):
        raise _link_error(target, link)
