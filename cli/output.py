"""Where results go: standard output, or a file that appears when it is complete; and the progress bar."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NoReturn, Self

from scenicq.errors import DataError, Diagnostic
from scenicq.store.atomic_files import WholeFile, whole_file
from scenicq.store.remote_path import AnyPath, RemotePath
from scenicq.store.targets import target_of

from .streams import results

if TYPE_CHECKING:
    from tqdm import tqdm

__all__ = ["ProgressBar", "choose_format", "destination", "writing"]

_EXTENSIONS = {".jsonl": "jsonl", ".csv": "csv", ".parquet": "parquet", ".txt": "ids"}


def choose_format(name: str | None, file: AnyPath | None) -> str:
    """Choose the format: as the user says, else by the file's extension, else what suits a terminal or a pipe.

    Raises:
        DataError: option-invalid: the extension names no format, or the format is not for terminals.
    """
    terminal = file is None and results().isatty()
    if name == "parquet" and terminal:
        hint = "`-o FILE` writes it to a file"
        raise DataError(Diagnostic("option-invalid", "Parquet cannot be shown on a terminal", hints=(hint,)))
    if name is not None:
        return name
    if file is None:
        return "table" if terminal else "jsonl"
    if file.suffix not in _EXTENSIONS:
        hint = f"known are {', '.join(_EXTENSIONS)}; `--format` chooses whatever the name is"
        raise DataError(Diagnostic("option-invalid", f"the name {file} does not say which format", hints=(hint,)))
    return _EXTENSIONS[file.suffix]


@contextlib.contextmanager
def writing(file: AnyPath | None) -> Generator[None]:
    """Turn errors of the operating system while results are written into a message about their target.

    Raises:
        DataError: target-unwritable.
    """
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        message = f"{file or 'standard output'} cannot be written: {error.strerror or error}"
        raise DataError(Diagnostic("target-unwritable", message)) from error


@contextlib.contextmanager
def destination(file: AnyPath | None, folder: AnyPath | None = None) -> Generator[BinaryIO]:
    """Open standard output, or a file that gets its name at the end.

    Args:
        file: The file; standard output if None.
        folder: Where it is written, made if need be; beside its place by default.

    Raises:
        DataError: target-unwritable.
    """
    if file is None:
        yield results().buffer
        # what is lost of the last bytes is told, too
        results().buffer.flush()
    elif isinstance(file, RemotePath):
        target_of(file).check_writable()
        with whole_file(file) as sink:
            yield sink
    elif file.exists() and not file.is_file() and not file.is_dir():
        with writing(file):
            device = file.open("wb")
        with device:
            yield device
    else:
        yield from _complete(file, Path(os.path.realpath(file)), folder if isinstance(folder, Path) else None)


def _complete(name: Path, file: Path, folder: Path | None) -> Generator[BinaryIO]:
    whole = WholeFile(file, folder)
    try:
        with writing(name):
            if file.is_dir():
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            if folder is not None:
                folder.mkdir(exist_ok=True)
            sink = whole.open()
        yield sink
        with writing(name):
            whole.finish()
    finally:
        whole.abandon()


class ProgressBar:
    """A progress bar on standard error; silent where that is no terminal."""

    def __init__(self, total: int | None = None, *, quiet: bool) -> None:
        """Show nothing yet.

        Args:
            total: Frames in all, if known.
            quiet: Whether to be silent anyway.
        """
        self._bar: tqdm[NoReturn] | None = None
        if not quiet and sys.stderr.isatty():
            from tqdm import tqdm  # noqa: PLC0415 - slow to load, and most runs have no terminal

            self._bar = tqdm(total=total, unit=" frames", leave=False, file=sys.stderr)

    def advance(self, frames: int) -> None:
        """Count so many frames more."""
        if self._bar is not None:
            self._bar.update(frames)

    def reach(self, frames: int, total: int) -> None:
        """Show that so many frames of a total are done."""
        if self._bar is not None:
            self._bar.total = total
            self._bar.update(frames - self._bar.n)

    def aside(self) -> contextlib.AbstractContextManager[None]:
        """Hide the bar while results are written to the same terminal."""
        return contextlib.nullcontext() if self._bar is None else self._bar.external_write_mode(file=sys.stderr)

    def __enter__(self) -> Self:
        """Return the bar itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.close()
