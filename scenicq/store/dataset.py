"""A dataset on disk, opened for reading.

Opening checks the manifest and the sizes of the files, not the checksums (`Dataset.verify` does). Readers share
nothing: every connection is an in-memory database with views over the manifest's files, so any number may read.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import duckdb

from scenicq.errors import DataError, Diagnostic
from scenicq.geometry.features import MapFeature
from scenicq.geometry.network import Network
from scenicq.store.frame_index import find_rows
from scenicq.store.labels import Label
from scenicq.store.manifest import Manifest, Part, read_manifest
from scenicq.store.reader import read_labels
from scenicq.store.regions import read_features
from scenicq.store.sql import sql_text

__all__ = ["Dataset", "open_dataset"]


@dataclass(frozen=True, slots=True)
class Dataset:
    """An opened dataset.

    Attributes:
        path: Its folder.
        manifest: What `dataset.json` says.
    """

    path: Path
    manifest: Manifest

    @property
    def maps(self) -> tuple[str, ...]:
        """Names of the maps, sorted; also of those that labels name but the source has not."""
        return tuple(sorted({*self.manifest.maps, *self.manifest.by_map}))

    def files(self, table: str) -> tuple[Path, ...]:
        """Absolute paths of a table's Parquet files, in the order of their rows."""
        root = self.path.resolve()
        return tuple(root / part.path for part in self.manifest.tables[table])

    def connect(self, *, threads: int | None = None, memory_limit: str | None = None) -> duckdb.DuckDBPyConnection:
        """An in-memory DuckDB with one view a table, that can read the dataset's files and nothing else.

        Args:
            threads: Upper bound of DuckDB's threads; DuckDB decides by default.
            memory_limit: Such as "2GB"; DuckDB decides by default.
        """
        config: dict[str, str | bool | int | float | list[str]] = {
            "autoinstall_known_extensions": False,
            "autoload_known_extensions": False,
        }
        if threads is not None:
            config["threads"] = threads
        if memory_limit is not None:
            config["memory_limit"] = memory_limit
        connection = duckdb.connect(":memory:", config=config)
        every: list[str] = []
        for table in self.manifest.tables:
            paths = [str(path) for path in self.files(table)]
            every += paths
            connection.execute(f"CREATE VIEW {table} AS SELECT * FROM read_parquet({_sql_list(paths)})")
        connection.execute(f"SET allowed_paths = {_sql_list(every)}")
        connection.execute("SET enable_external_access = false")
        return connection

    def features(self, map_name: str) -> tuple[MapFeature, ...]:
        """The elements of a map in its own order; none where the source has no such map."""
        return read_features(self.files("regions"), map_name)

    def network(self, map_name: str) -> Network:
        """The road network of a map; empty where the source has no such map."""
        return Network(map_name, self.features(map_name))

    def labels(self, frames: Iterable[str] | None = None) -> Iterator[Label]:
        """Labels in order of recording, time and frame, read in batches: memory does not grow with the dataset.

        Of chosen frames only the row groups that hold them are read, each once.

        Args:
            frames: Only these frames; names that the dataset lacks are ignored. All by default.
        """
        wanted = None if frames is None else frozenset(frames)
        parts = list(zip(*(self.files(table) for table in ("labels", "objects", "sensors")), strict=True))
        rows = None if wanted is None else find_rows(self.files("frame_index"), wanted)
        return read_labels(parts, rows, wanted)

    def verify(self) -> None:
        """Compare every file with its checksum.

        Raises:
            DataError: `store-damaged`, one diagnostic a file.
        """
        problems = [
            Diagnostic("store-damaged", f"{part.path} has changed since it was written")
            for parts in self.manifest.tables.values()
            for part in parts
            if _checksum(self.path / part.path) != part.sha256
        ]
        if problems:
            raise DataError(problems)


def open_dataset(path: str | Path) -> Dataset:
    """Open a dataset folder.

    Raises:
        DataError: `store-missing`, `store-version`, or `store-damaged` where a file is missing or has another size.
    """
    folder = Path(path)
    manifest = read_manifest(folder)
    parts = [part for parts in manifest.tables.values() for part in parts]
    problems = [problem for part in parts if (problem := _problem(folder, part))]
    if problems:
        raise DataError(problems)
    return Dataset(folder, manifest)


def _problem(folder: Path, part: Part) -> Diagnostic | None:
    try:
        size = (folder / part.path).stat().st_size
    except OSError:
        return Diagnostic("store-damaged", f"{part.path} is missing", hints=("ingest the source again",))
    if size == part.bytes:
        return None
    message = f"{part.path} has {size} bytes, not {part.bytes}"
    return Diagnostic("store-damaged", message, hints=("ingest the source again",))


def _sql_list(texts: Iterable[str]) -> str:
    return "[" + ", ".join(map(sql_text, texts)) + "]"


def _checksum(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
