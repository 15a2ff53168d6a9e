"""Datasets on object storage, or wherever else fsspec reads: the extra `scenicq[s3]`.

Only ranges of bytes are asked for, never whole files: the end of a Parquet file, where it says what is where, and the
columns of row groups that are needed. DuckDB and pyarrow read through the same files. Credentials are the affair of the
package for the protocol; for S3 they come from the usual variables and files of AWS.
"""

# fsspec is optional and has no types.
# pyright: reportIncompatibleMethodOverride=false, reportMissingImports=false, reportUnknownParameterType=false, reportUntypedBaseClass=false

from __future__ import annotations

import hashlib
import io
import threading
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, BinaryIO, Self, cast

from scenicq.errors import DataError, Diagnostic
from scenicq.recent import Recent
from scenicq.store.manifest import MANIFEST, Part

if TYPE_CHECKING:  # an ingest needs no DuckDB, which is slow to load
    import duckdb

__all__ = ["RemoteFile", "RemoteFolder", "ask", "file_system", "why_not"]

_TAIL = 1 << 17
"""Bytes at the end of a file that are fetched when it is first opened, and kept: enough for almost any footer."""
_TAILS = 512
"""Files whose ends are kept."""
_BLOCK = 1 << 24
_PATIENCE_S = 60
"""Seconds that a request may take, with all that is tried again."""
_SLOWEST = 1_000_000
"""Bytes a second below which a transfer counts as one that does not answer."""
_SCHEME = "scenicq"
"""The scheme of addresses in SQL, whatever the real ones are."""
_INSTALL = {
    "s3": "`pip install 'scenicq[s3]'` adds it",
    "gs": "`pip install 'scenicq[s3]' gcsfs` adds it",
    "abfs": "`pip install 'scenicq[s3]' adlfs` adds it",
}


@dataclass(frozen=True, slots=True)
class RemoteFile:
    """A file of a dataset elsewhere.

    Attributes:
        folder: Where it is.
        part: What the manifest says of it.
    """

    folder: RemoteFolder
    part: Part

    def __str__(self) -> str:
        """Its address in SQL."""
        return f"{_SCHEME}://{self.part.path}"

    def open(self) -> BinaryIO:
        """The file for reading, from any number of threads."""
        return cast("BinaryIO", _Reading(self.folder, self.part))


@dataclass(frozen=True, slots=True, eq=False)
class RemoteFolder:
    """A dataset elsewhere.

    Attributes:
        name: Its address, as the user gave it.
        files: The file system of fsspec.
        root: The dataset's folder in it.
    """

    name: str
    files: Any = field(repr=False)
    root: str
    _tails: Recent[str, bytes] = field(default_factory=lambda: Recent(_TAILS), init=False, repr=False)
    _failures: deque[DataError] = field(default_factory=lambda: deque[DataError](maxlen=1), init=False, repr=False)

    @classmethod
    def at(cls, address: str) -> Self:
        """The folder at an address.

        Raises:
            DataError: option-invalid: the package for the protocol is not installed, or there is no such protocol.
        """
        return cls(address, *file_system(address))

    @property
    def address(self) -> str:
        """The address."""
        return self.name

    def manifest(self) -> bytes:
        """The content of `dataset.json`, as it is now.

        Raises:
            DataError: store-missing, store-unreachable.
        """
        try:
            return bytes(self._ask("cat_file", MANIFEST))
        except FileNotFoundError as error:
            hint = "`scenicq ingest SOURCE DATASET` makes a dataset, to be copied there as a folder"
            raise DataError(Diagnostic("store-missing", f"{self.name} has no {MANIFEST}", hints=(hint,))) from error
        except Exception as error:
            # every protocol has exceptions of its own
            raise _unreachable(self.name, error) from error

    def problems(self, parts: Iterable[Part]) -> list[Diagnostic]:
        """None: asking would cost a request a file, and reading shows what is wrong."""
        return []

    def file(self, part: Part) -> RemoteFile:
        """A file of the dataset."""
        return RemoteFile(self, part)

    def checksum(self, part: Part) -> str:
        """SHA-256 of a file; nothing where it is missing or has another size."""
        digest = hashlib.sha256()
        try:
            if self._ask("info", part.path)["size"] != part.bytes:
                return ""
            for start in range(0, part.bytes, _BLOCK):
                digest.update(self.fetch(part, start, min(start + _BLOCK, part.bytes)))
        except FileNotFoundError:
            return ""
        except DataError as error:
            if error.diagnostics[0].code == "store-damaged":
                return ""
            raise
        except Exception as error:
            raise _unreachable(f"{part.path} in {self.name}", error) from error
        return digest.hexdigest()

    def stamp(self, parts: Iterable[Part]) -> str:
        """The address: files are called after their content, and asking after each would cost a request."""
        return self.name

    def admit(self, connection: duckdb.DuckDBPyConnection, parts: Iterable[Part]) -> None:
        """Let a connection read files of the dataset, and no others, by their names in SQL."""
        connection.register_filesystem(_mount()(self, {part.path: part for part in parts}))

    def fetch(self, part: Part, start: int, end: int) -> bytes:
        """A range of bytes of a file.

        Raises:
            DataError: store-damaged: the file is missing or shorter; store-unreachable. DuckDB makes texts of what is
                raised while it reads: `failure` still has it.
        """
        try:
            return self._fetched(part, start, end)
        except DataError as error:
            self._failures.append(error)
            raise

    def failure(self) -> DataError | None:
        """The last failure since somebody asked, told once."""
        return self._failures.pop() if self._failures else None

    def _fetched(self, part: Part, start: int, end: int) -> bytes:
        try:
            data = bytes(self._ask("cat_file", part.path, start=start, end=end))
        except FileNotFoundError as error:
            raise DataError(Diagnostic("store-damaged", f"{self.name} lacks {part.path}", hints=_AGAIN)) from error
        except Exception as error:
            raise _unreachable(f"{part.path} in {self.name}", error) from error
        if len(data) != end - start:
            message = f"{part.path} in {self.name} has not the size that it should have"
            raise DataError(Diagnostic("store-damaged", message, hints=_AGAIN))
        return data

    def _ask(self, method: str, path: str, **options: Any) -> Any:
        """Call a method of the file system; where nothing answers in time, its retries end, too.

        Raises:
            TimeoutError: After `_PATIENCE_S`.
        """
        return ask(self.files, method, f"{self.root}/{path}", **options)

    def tail(self, part: Part) -> bytes:
        """The end of a file."""
        return self._tails.get(part.path, lambda: self.fetch(part, max(0, part.bytes - _TAIL), part.bytes))


def file_system(address: str) -> tuple[Any, str]:
    """The file system of fsspec that an address is in, and the place there.

    Raises:
        DataError: option-invalid: the package for the protocol is not installed, or there is no such protocol.
    """
    protocol = address.partition("://")[0]
    if find_spec("fsspec") is None:
        message = f"{address} needs the package fsspec, which is not installed"
        raise DataError(Diagnostic("option-invalid", message, hints=(_INSTALL["s3"],)))
    from fsspec.core import url_to_fs  # noqa: PLC0415 - optional

    try:
        files, root = url_to_fs(address)
    except (ImportError, ValueError) as error:
        hints = (_INSTALL[protocol],) if protocol in _INSTALL else ()
        message = f"{address} cannot be reached: {_line(error)}"
        raise DataError(Diagnostic("option-invalid", message, hints=hints)) from error
    return files, root.rstrip("/")


def ask(files: Any, method: str, *given: Any, size: int = 0, **options: Any) -> Any:
    """Call a method of a file system of fsspec; where nothing answers in time, its retries end, too.

    Args:
        files: The file system.
        method: Its name.
        given: Positional arguments.
        size: Bytes that are to be sent or fetched.
        options: Arguments by name.

    Raises:
        TimeoutError: After `_PATIENCE_S` seconds, and what so many bytes take.
        Exception: Whatever the protocol raises.
    """
    if not getattr(files, "async_impl", False):
        return getattr(files, method)(*given, **options)
    from fsspec.asyn import sync  # noqa: PLC0415 - optional

    patience_s = _PATIENCE_S + size / _SLOWEST
    return sync(files.loop, getattr(files, f"_{method}"), *given, timeout=patience_s, **options)


def _line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def why_not(what: str, error: Exception) -> tuple[str, tuple[str, ...]]:
    """Say what cannot be done elsewhere, and why: a message, and hints.

    Args:
        what: Such as `s3://bucket/town cannot be read`.
        error: What the protocol has raised.
    """
    line = f"nothing answers within {_PATIENCE_S} s" if isinstance(error, TimeoutError) else _line(error)
    named = f"{type(error).__name__} {line}".lower()
    # S3 calls a request bad whose token has expired, where the answer has no text
    refused = isinstance(error, PermissionError) or any(
        each in named for each in ("credential", "token", "bad request")
    )
    return (f"{what} with these credentials: {line}", _CREDENTIALS) if refused else (f"{what}: {line}", ())


def _unreachable(what: str, error: Exception) -> DataError:
    message, hints = why_not(f"{what} cannot be read", error)
    return DataError(Diagnostic("store-unreachable", message, hints=hints))


_CREDENTIALS = (
    "those for S3 come from the variables and files of AWS (AWS_PROFILE, AWS_ACCESS_KEY_ID, ~/.aws), and may expire",
)
_AGAIN = ("copy the dataset there again, its `dataset.json` last",)


class _Reading(io.RawIOBase):
    """A file that is read by ranges.

    Every thread has a position of its own: DuckDB reads one file from several, moving and reading in two steps.
    """

    def __init__(self, folder: RemoteFolder, part: Part) -> None:
        super().__init__()
        self._folder, self._part = folder, part
        self._here = threading.local()

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return cast("int", getattr(self._here, "position", 0))

    def seek(self, offset: int, whence: int = 0, /) -> int:
        self._here.position = offset + (0, self.tell(), self._part.bytes)[whence]
        return self.tell()

    def read(self, size: int = -1, /) -> bytes:
        start = self.tell()
        end = self._part.bytes if size < 0 else min(start + size, self._part.bytes)
        if start >= end:
            return b""
        first = self._part.bytes - _TAIL
        if start >= first:
            tail = self._folder.tail(self._part)
            data = tail[start - max(0, first) : end - max(0, first)]
        else:
            data = self._folder.fetch(self._part, start, end)
        self._here.position = end
        return data

    def readall(self) -> bytes:
        return self.read()

    def readinto(self, buffer: Any, /) -> int:
        data = self.read(len(buffer))
        buffer[: len(data)] = data
        return len(data)


@cache
def _mount() -> type[Any]:
    """The class by which DuckDB sees the files of one dataset."""
    from fsspec.spec import AbstractFileSystem  # noqa: PLC0415 - optional

    class Mount(AbstractFileSystem):
        protocol = _SCHEME
        cachable = False

        def __init__(self, folder: RemoteFolder, parts: Mapping[str, Part]) -> None:
            super().__init__()
            self._folder, self._parts = folder, parts

        def _part(self, path: str) -> Part:
            return self._parts[path.removeprefix(f"{_SCHEME}://")]

        def open(self, path: str, mode: str = "rb", **_: Any) -> BinaryIO:
            if mode != "rb":
                raise PermissionError(f"{path} is only to be read")
            return RemoteFile(self._folder, self._part(path)).open()

        def info(self, path: str, **_: Any) -> dict[str, Any]:
            return {"name": path, "size": self._part(path).bytes, "type": "file"}

        def glob(self, path: str, **_: Any) -> list[str]:
            return [path]

        def modified(self, path: str) -> datetime:
            return datetime.fromtimestamp(0, UTC)

    return Mount
