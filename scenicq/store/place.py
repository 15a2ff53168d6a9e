"""Where a dataset's files are: a folder of this machine, or any address that fsspec understands.

Everything that reads a dataset reads through here, and only files of the dataset: names come from the manifest, which
may be a stranger's.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Protocol, Self

import pyarrow.parquet as pq

from scenicq.errors import DataError, Diagnostic
from scenicq.store.manifest import MANIFEST, Manifest, Part, check_path, find_links
from scenicq.store.read_lock import Reading
from scenicq.store.remote import RemoteFile, RemoteFolder
from scenicq.store.remote_path import is_address, local_path

if TYPE_CHECKING:  # an ingest needs no DuckDB, which is slow to load
    import duckdb

__all__ = ["LocalFolder", "Place", "StoreFile", "find_place", "open_parquet", "stamp_of"]

StoreFile = Path | RemoteFile
"""A file of a table."""


class Place(Protocol):
    """A folder that holds a dataset."""

    @property
    def name(self) -> str:
        """The dataset's name in messages, as the user gave it."""
        ...

    @property
    def address(self) -> str:
        """An address that any process with the same files can open."""
        ...

    def manifest(self) -> bytes:
        """The content of `dataset.json`.

        Raises:
            DataError: store-missing.
        """
        ...

    def problems(self, parts: Iterable[Part]) -> list[Diagnostic]:
        """What is wrong with files, as far as can be told without reading them."""
        ...

    def file(self, part: Part) -> StoreFile:
        """A file of the dataset."""
        ...

    def checksum(self, part: Part) -> str:
        """SHA-256 of a file, in hexadecimal."""
        ...

    def stamp(self, parts: Iterable[Part]) -> str:
        """A text that changes with any file, as far as the place can tell without reading them."""
        ...

    def failure(self) -> DataError | None:
        """The last reason why a file could not be read, told once; DuckDB says only that it could not."""
        ...

    def admit(self, connection: duckdb.DuckDBPyConnection, parts: Iterable[Part]) -> None:
        """Let a connection read files of the dataset."""
        ...


@dataclass(frozen=True, slots=True)
class LocalFolder:
    """A folder of this machine.

    Attributes:
        path: As the user gave it.
    """

    path: Path
    _root: Path = field(repr=False)
    _reading: Reading = field(repr=False, compare=False)

    @classmethod
    def at(cls, path: Path) -> Self:
        """Take a folder, and lock it for reading.

        Raises:
            DataError: `store-missing` where its path is no text.
        """
        check_path(path, "store-missing")
        return cls(path, path.resolve(), Reading(path))

    def release(self) -> None:
        """Let writers remove the files of a version that has been replaced."""
        self._reading.end()

    @property
    def name(self) -> str:
        """The path."""
        return str(self.path)

    @property
    def address(self) -> str:
        """The absolute path."""
        return str(self._root)

    def manifest(self) -> bytes:
        """The content of `dataset.json`."""
        try:
            return (self._root / MANIFEST).read_bytes()
        except OSError as error:
            hint = "`scenicq ingest SOURCE DATASET` makes a dataset"
            raise DataError(Diagnostic("store-missing", f"{self.path} has no {MANIFEST}", hints=(hint,))) from error

    def problems(self, parts: Iterable[Part]) -> list[Diagnostic]:
        """Folders that are links; else files that are missing, have another size, or lead out of the folder."""
        if links := find_links(self._root):
            told = ", ".join(str(each.relative_to(self._root)) for each in links)
            hint = "copy the whole dataset there; its own folder may be a link"
            return [
                Diagnostic("store-damaged", f"{self.path}: folders of a dataset are no links: {told}", hints=(hint,))
            ]
        found = [problem for part in parts if (problem := _problem(self._root, part))]
        if found and not (self._root / MANIFEST).exists():
            # whoever removes a dataset removes all of it
            told = f"{self.path} is not there any more: it was removed or moved while it was read"
            return [Diagnostic("store-damaged", told, hints=("ingest the source again",))]
        return found

    def file(self, part: Part) -> Path:
        """Its absolute path."""
        return self._root / part.path

    def checksum(self, part: Part) -> str:
        """SHA-256 of a file; nothing where it has gone."""
        try:
            with (self._root / part.path).open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
        except OSError:
            return ""

    def stamp(self, parts: Iterable[Part]) -> str:
        """Identity, size and times of change of every file."""
        try:
            found = [(self._root / part.path).stat() for part in parts]
        except OSError as error:
            message = f"{self.path} has changed since it was opened: {error.filename}: {error.strerror}"
            raise DataError(Diagnostic("store-damaged", message, hints=("run it again",))) from error
        return str([(each.st_ino, each.st_size, each.st_mtime_ns, each.st_ctime_ns) for each in found])

    def failure(self) -> None:
        """Nothing: the files can be looked at again."""

    def admit(self, connection: duckdb.DuckDBPyConnection, parts: Iterable[Part]) -> None:
        """Nothing to do: DuckDB knows files."""


def _problem(root: Path, part: Part) -> Diagnostic | None:
    hints = ("ingest the source again",)
    path = root / part.path
    try:
        if not path.resolve().is_relative_to(root):
            return Diagnostic("store-damaged", f"{part.path} is a link out of the dataset", hints=hints)
        size = path.stat().st_size
    except OSError:
        return Diagnostic("store-damaged", f"{part.path} is missing", hints=hints)
    if size == part.bytes:
        return None
    return Diagnostic("store-damaged", f"{part.path} has {size} bytes, not {part.bytes}", hints=hints)


def find_place(address: str | Path) -> Place:
    """Find the place of a path, or of an address such as `s3://bucket/dataset`.

    Raises:
        DataError: option-invalid: what the address needs is not installed.
    """
    text = str(address)
    if isinstance(address, Path):
        return LocalFolder.at(address)
    return RemoteFolder.at(text) if is_address(text) else LocalFolder.at(local_path(text))


def stamp_of(place: Place, manifest: Manifest) -> str:
    """A text that changes whenever a file of a dataset may have changed.

    Args:
        place: Where the dataset is.
        manifest: The dataset's manifest.
    """
    every = (part for parts in manifest.tables.values() for part in parts)
    return hashlib.sha256(place.manifest() + place.stamp(every).encode()).hexdigest()


def open_parquet(file: StoreFile, **options: Any) -> pq.ParquetFile:
    """Open a file as a `pyarrow.parquet.ParquetFile`; the caller closes it.

    Args:
        file: The file.
        options: What `ParquetFile` takes besides.
    """
    if isinstance(file, Path):
        return pq.ParquetFile(file, **options)
    source: BinaryIO = file.open()
    # neighbouring columns come in one request
    return pq.ParquetFile(source, pre_buffer=True, **options)
