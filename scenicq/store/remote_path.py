"""Files and folders elsewhere: the methods of `Path` that writers and readers of whole files use, over fsspec.

An object appears with its whole content or not at all; nothing else is atomic there. Where there are several,
`targets` sends the last one when all others are there.
"""

# fsspec is optional and has no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false

from __future__ import annotations

import errno
import os
from contextlib import suppress
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath
from typing import Any, Self
from urllib.parse import unquote

from scenicq.errors import DataError, Diagnostic
from scenicq.store.remote import ask, file_system, why_not

__all__ = ["AnyPath", "RemotePath", "any_path", "is_address", "local_path"]


def is_address(text: str) -> bool:
    """Whether a text is an address such as `s3://bucket/x`, and no path; `file://` names a path."""
    return "://" in text and not text.startswith("file://")


def local_path(given: str) -> Path:
    """Make a path of a text that is no address."""
    if not given.startswith("file://"):
        return Path(given)
    # all of it is the path: a question mark begins no query
    return Path(unquote(given.removeprefix("file://").removeprefix("localhost")))


def any_path(given: str | AnyPath) -> AnyPath:
    """The path, or the place elsewhere, that a user names.

    Raises:
        DataError: option-invalid: what the address needs is not installed, or it names nothing.
    """
    if not isinstance(given, str):
        return given
    return RemotePath.at(given) if is_address(given) else local_path(given)


@dataclass(frozen=True, slots=True)
class RemotePath:
    """A file or folder elsewhere.

    Methods raise what those of a `Path` do where something is not there or is of another kind, and else DataError
    (`target-unwritable`, `store-unreachable`) in words.

    Attributes:
        address: As the user gave it.
        files: The file system of fsspec.
        place: Where it is in that.
    """

    address: str
    files: Any = field(repr=False, compare=False)
    place: str = field(repr=False, compare=False)

    @classmethod
    def at(cls, address: str) -> Self:
        """Take the place that an address names.

        Raises:
            DataError: option-invalid.
        """
        files, place = file_system(address)
        if not PurePosixPath(place).name:
            raise DataError(Diagnostic("option-invalid", f"{address} names no file and no folder"))
        return cls(address.rstrip("/"), files, place)

    def __str__(self) -> str:
        """The address."""
        return self.address

    def __truediv__(self, name: str | Path) -> RemotePath:
        """What has a name in this folder."""
        below = PurePosixPath(name).as_posix()
        return RemotePath(f"{self.address}/{below}", self.files, f"{self.place}/{below}")

    @property
    def name(self) -> str:
        """The last part of the address."""
        return PurePosixPath(self.place).name

    @property
    def stem(self) -> str:
        """The name without its extension."""
        return PurePosixPath(self.name).stem

    @property
    def suffix(self) -> str:
        """The extension of the name, with its dot."""
        return PurePosixPath(self.name).suffix

    def with_name(self, name: str) -> RemotePath:
        """The place with another name in the same folder."""
        cut = len(self.name)
        return RemotePath(f"{self.address[:-cut]}{name}", self.files, f"{self.place[:-cut]}{name}")

    def _kind(self) -> str:
        self.files.invalidate_cache()
        try:
            return str(ask(self.files, "info", self.place)["type"])
        except FileNotFoundError:
            return ""
        except Exception as error:
            raise self._unreachable(error) from error

    def exists(self) -> bool:
        """Whether there is a file, or a folder with something in it."""
        return bool(self._kind())

    def is_file(self) -> bool:
        """Whether there is a file."""
        return self._kind() == "file"

    def is_dir(self) -> bool:
        """Whether there is a folder with something in it."""
        return self._kind() == "directory"

    def iterdir(self) -> list[RemotePath]:
        """What lies in the folder, in the order of names; nothing where there is none."""
        self.files.invalidate_cache()
        try:
            found = ask(self.files, "ls", self.place, detail=False)
        except FileNotFoundError:
            return []
        except Exception as error:
            raise self._unreachable(error) from error
        names = {PurePosixPath(each).name for each in found}
        return [self / name for name in sorted(names)]

    def glob(self, pattern: str) -> list[RemotePath]:
        """What lies in the folder itself and has a name like this."""
        return [each for each in self.iterdir() if fnmatchcase(each.name, pattern)]

    def read_bytes(self) -> bytes:
        """The whole content.

        Raises:
            OSError: There is no such file.
            DataError: store-unreachable.
        """
        try:
            size = int(ask(self.files, "info", self.place)["size"] or 0)
            return bytes(ask(self.files, "cat_file", self.place, size=size))
        except FileNotFoundError:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(self)) from None
        except Exception as error:
            raise self._unreachable(error) from error

    def put(self, file: Path) -> None:
        """Send a file of this machine here, all at once.

        Raises:
            DataError: target-unwritable.
        """
        try:
            ask(self.files, "put_file", str(file), self.place, size=file.stat().st_size)
        except Exception as error:
            raise self._unwritable(error) from error

    def check_writable(self) -> None:
        """Check before the work that it can be written: an empty file beside it is made and removed.

        Raises:
            DataError: target-unwritable.
        """
        trial = self.with_name(f".{self.name}.{os.getpid()}.tmp")
        try:
            ask(self.files, "pipe_file", trial.place, b"")
        except Exception as error:
            raise self._unwritable(error) from error
        trial.remove()

    def remove(self) -> None:
        """Remove the file, as far as that may be."""
        with suppress(Exception):
            ask(self.files, "rm_file", self.place)

    def remove_folder(self) -> None:
        """Remove the folder with all in it, as far as that may be."""
        with suppress(Exception):
            ask(self.files, "rm", self.place, recursive=True)

    def _unreachable(self, error: Exception) -> DataError:
        message, hints = why_not(f"{self} cannot be read", error)
        return DataError(Diagnostic("store-unreachable", message, hints=hints))

    def _unwritable(self, error: Exception) -> DataError:
        message, hints = why_not(f"{self} cannot be written", error)
        return DataError(Diagnostic("target-unwritable", message, hints=hints))


AnyPath = Path | RemotePath
"""A file or folder of this machine, or elsewhere."""
