"""A shared lock on the folder of a dataset that is read: files of an older version stay until nobody reads them.

The lock is a courtesy. Where there is none (other systems, some network file systems) a reader whose files go away ends
with an error, never with rows of two versions: a file's name depends on its content.
"""

from __future__ import annotations

import os
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:
    fcntl = None

__all__ = ["Reading", "nobody_reads"]

_TRIES, _PAUSE_S = 100, 0.01
"""How long a reader waits for a writer that removes old files."""


class Reading:
    """The lock of one reader, held from the start until `end`, or until nobody refers to it."""

    def __init__(self, folder: Path) -> None:
        """Take the lock, if there is one to be had.

        Args:
            folder: The dataset's folder.
        """
        self._folder = folder
        self._handle: int | None = None
        if fcntl is None:
            return
        try:
            self._handle = os.open(folder, os.O_RDONLY)
        except OSError:
            return
        for _ in range(_TRIES):
            try:
                fcntl.flock(self._handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                time.sleep(_PAUSE_S)
            except OSError:
                return
            else:
                return

    def end(self) -> None:
        """End."""
        # of what could not be made nothing is there
        handle, self._handle = getattr(self, "_handle", None), None
        if handle is not None:
            os.close(handle)

    def __reduce__(self) -> tuple[type[Reading], tuple[Path]]:
        """A copy, also in another process, has a lock of its own: the number of a file means nothing elsewhere."""
        return Reading, (self._folder,)

    def __del__(self) -> None:
        self.end()


@contextmanager
def nobody_reads(folder: Path) -> Generator[bool]:
    """Whether nobody reads a dataset; if so, nobody can begin to while the block runs.

    Raises:
        OSError: The folder cannot be locked.
    """
    if fcntl is None:
        yield True
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
        else:
            yield True
    finally:
        os.close(handle)
