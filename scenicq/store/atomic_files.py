"""Write files and folders so that they are complete or not there, wherever their target is."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from scenicq.errors import DataError
from scenicq.store.remote_path import AnyPath
from scenicq.store.targets import open_staged, target_of

__all__ = ["COMPLETE", "WholeFile", "whole_file", "whole_folder", "write_whole"]

COMPLETE = "_SUCCESS"
"""The empty file that comes last into a folder elsewhere, as jobs of Hadoop and Spark leave it."""


class WholeFile:
    """A file that gets its name when it is complete.

    Under the name a reader finds what was there before, or the complete file, even if the machine stops. `whole_file`
    does the same in a `with` statement; this class tells errors of the file from errors of its writer.
    """

    def __init__(self, path: AnyPath, folder: Path | None = None) -> None:
        """Choose the names; nothing is written yet.

        Args:
            path: The file.
            folder: Where a file of this machine is written, on the same file system; beside its place by default.
        """
        self._target, self._folder = target_of(path), folder
        self._staged: Path | None = None
        self._file: BinaryIO | None = None

    def open(self) -> BinaryIO:
        """The file, to be written.

        Raises:
            OSError: The folder cannot be written.
        """
        # first of all the name: an interrupt may come when the file is there and has not been handed on
        self._staged = self._target.stage_file(self._folder)
        self._file = open_staged(self._staged)
        return self._file

    def finish(self) -> None:
        """Give the file its name.

        Raises:
            OSError: What was written does not reach the disk.
            DataError: target-unwritable: it cannot be sent; it stays on this machine, and is named.
        """
        assert self._file is not None
        assert self._staged is not None
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()
        try:
            self._target.publish_file(self._staged)
        except DataError:
            self._staged = None
            raise

    def abandon(self) -> None:
        """Remove what is not finished; nothing where all is."""
        if self._file is not None:
            with suppress(OSError):  # what is left in the buffer may not fit on the disk
                self._file.close()
        if self._staged is not None:
            self._target.discard_file(self._staged)


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
    target = target_of(path)
    if target.is_taken():
        raise FileExistsError
    with target.new_folder(last) as folder:
        yield folder
