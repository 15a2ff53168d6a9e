"""Programs read from files, and the files that they import."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from scenicq.errors import DataError, Diagnostic, Source

__all__ = ["read_program", "sibling_loader"]


def read_program(path: str | Path) -> Source:
    """Read a scenario.

    Raises:
        DataError: file-missing, or file-invalid where it is not UTF-8 text.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{path} cannot be read: {error.strerror}")) from None
    try:
        return Source(str(path), data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise DataError(Diagnostic("file-invalid", f"{path} is not text in UTF-8")) from None


def sibling_loader(path: Path) -> Callable[[str], Source | None]:
    """What reads the files that a program imports: those in its own folder, nothing else.

    Args:
        path: Of the program.
    """
    folder = path.resolve().parent

    def load(name: str) -> Source | None:
        file = (folder / name).resolve()
        if not file.is_relative_to(folder) or not file.is_file():
            return None
        return read_program(file)

    return load
