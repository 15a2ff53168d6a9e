"""Which files a folder of a stranger has: only regular ones, since a pipe or a device may never end."""

from __future__ import annotations

from pathlib import Path

__all__ = ["first_files", "read_bytes", "readable"]


def first_files(folder: Path, *patterns: str) -> list[Path]:
    """The regular files of the first pattern that has any, sorted."""
    for pattern in patterns:
        if found := sorted(path for path in folder.glob(pattern) if path.is_file()):
            return found
    return []


def readable(name: object) -> str:
    """A name for tables and messages: names of files, and what a command line gives, need not be text."""
    return str(name).encode(errors="backslashreplace").decode()


def read_bytes(path: Path) -> bytes:
    """The content of a regular file.

    Raises:
        OSError: It cannot be read, or is none.
    """
    if path.exists() and not path.is_file():
        raise OSError(None, "it is not a file")
    return path.read_bytes()
