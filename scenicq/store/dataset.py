"""A dataset on disk, opened for reading.

Opening checks the manifest and the sizes of the files, not the checksums (`Dataset.verify` does). Readers share
nothing: every connection is an in-memory database with views over the manifest's files, so any number may read.
"""

from __future__ import annotations

import sys
import weakref
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic, ScenicqError
from scenicq.geometry.features import MapFeature
from scenicq.geometry.map_traits import MapTraits
from scenicq.geometry.network import Network
from scenicq.store.frame_index import find_rows
from scenicq.store.frame_names import ShortNames, find_frame, name_shorteners
from scenicq.store.in_memory import connect_in_memory
from scenicq.store.labels import Label
from scenicq.store.manifest import Manifest, read_manifest
from scenicq.store.place import LocalFolder, Place, StoreFile, find_place
from scenicq.store.reader import read_labels
from scenicq.store.recorded_tracks import RecordedTracks
from scenicq.store.regions import MapFiles
from scenicq.store.scans import allowed_paths, scan
from scenicq.store.sql import sql_list

if TYPE_CHECKING:
    import duckdb

__all__ = ["Dataset", "DatasetReference", "open_dataset"]


@dataclass(frozen=True, slots=True)
class DatasetReference:
    """What another process needs to open the same version of a dataset.

    Attributes:
        address: Where it is.
        digest: The digest of its tables.
    """

    address: str
    digest: str

    def open(self, *, check: bool = False) -> Dataset:
        """Open the dataset.

        Args:
            check: As `open_dataset` has it.

        Raises:
            DataError: As `open_dataset` does; store-damaged where the dataset there is not the one that was meant.
        """
        dataset = open_dataset(self.address, check=check)
        if dataset.manifest.digest != self.digest:
            message = f"{self.address} has changed since the query began, or is another one where it is read"
            raise DataError(Diagnostic("store-damaged", message, hints=("run the query again",)))
        return dataset


@dataclass(frozen=True, slots=True, weakref_slot=True)
class Dataset:
    """An opened dataset.

    Attributes:
        place: Where its files are.
        manifest: What `dataset.json` says.
        recorded: The tracks of its recordings.
        mapped: The files of its maps.
    """

    place: Place
    manifest: Manifest
    recorded: RecordedTracks = field(init=False, compare=False, repr=False)
    mapped: MapFiles = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Nothing of its tracks and maps is read before it is asked for."""
        # not of the dataset itself, which would live until somebody looks for circles
        files = partial(_files, self.place, self.manifest)
        object.__setattr__(self, "recorded", RecordedTracks(files))
        object.__setattr__(self, "mapped", MapFiles(files("regions"), self.manifest.map_groups))

    @property
    def name(self) -> str:
        """Its path or address, as the user gave it."""
        return self.place.name

    @property
    def address(self) -> str:
        """What opens the dataset in any process that sees the same files."""
        return self.place.address

    @property
    def folder(self) -> Path | None:
        """Its folder, if it is on this machine."""
        return self.place.path if isinstance(self.place, LocalFolder) else None

    @property
    def path(self) -> Path:
        """Its folder.

        Raises:
            DataError: option-invalid: it is not on this machine.
        """
        if self.folder is None:
            message = f"{self.name} can only be read: this needs a dataset on this machine"
            raise DataError(Diagnostic("option-invalid", message))
        return self.folder

    @property
    def reference(self) -> DatasetReference:
        """What opens this version of the dataset, and no other, in any process that sees the same files."""
        return DatasetReference(self.address, self.manifest.digest)

    def __reduce__(self) -> tuple[Callable[[DatasetReference], Dataset], tuple[DatasetReference]]:
        """A copy, also in another process, is opened anew: it reads under a lock of its own."""
        return DatasetReference.open, (self.reference,)

    def release(self) -> None:
        """Let writers remove the files of this version once there is a newer one."""
        if isinstance(self.place, LocalFolder):
            self.place.release()

    @property
    def maps(self) -> tuple[str, ...]:
        """Names of the maps, sorted, including those that labels name and the source lacks."""
        return self.manifest.named_maps

    def files(self, table: str) -> tuple[StoreFile, ...]:
        """A table's Parquet files, in the order of their rows; absolute paths where they are on this machine."""
        return _files(self.place, self.manifest, table)

    def scan(self, table: str, part: int | None = None, *, numbered: bool = False) -> str:
        """The text that SQL selects from to read a table; see `scans.scan`.

        Args:
            table: Name of the table.
            part: Number of the part; all by default.
            numbered: Whether there is also `file_row_number`, the number of each row in its file.
        """
        files = self.files(table)
        return scan(table, files if part is None else [files[part]], numbered=numbered)

    def connect(
        self, *, threads: int | None = None, memory_limit: str | None = None, views: bool = True
    ) -> duckdb.DuckDBPyConnection:
        """An in-memory DuckDB with one view a table, that can read the dataset's files and nothing else.

        Args:
            threads: Upper bound of DuckDB's threads; DuckDB decides by default.
            memory_limit: Such as "2GB"; DuckDB decides by default.
            views: Whether the tables are there as views; else only `files` can be read.
        """
        config: dict[str, bool | int | str] = {
            "autoinstall_known_extensions": False,
            "autoload_known_extensions": False,
        }
        if threads is not None:
            config["threads"] = threads
        if memory_limit is not None:
            config["memory_limit"] = memory_limit
        connection = connect_in_memory(config)
        # shapes are not for SQL, and DuckDB 1.5.0 refuses those without a coordinate reference system
        connection.execute("SET enable_geoparquet_conversion = false")
        self.place.admit(connection, (part for parts in self.manifest.tables.values() for part in parts))
        with self.blamed():
            for table in self.manifest.tables if views else ():
                connection.execute(f"CREATE VIEW {table} AS FROM {self.scan(table)}")
        every = [file for table in self.manifest.tables for file in self.files(table)]
        connection.execute(f"SET allowed_paths = {sql_list(allowed_paths(every))}")
        connection.execute("SET enable_external_access = false")
        return connection

    def features(self, map_name: str) -> tuple[MapFeature, ...]:
        """The elements of a map in its own order; none where the source has no such map."""
        with self.blamed():
            return self.mapped.features(map_name)

    def network(self, map_name: str) -> Network:
        """The road network of a map, which is read when that is needed; empty where the source has no such map."""
        # a network lives until somebody looks for circles, and the dataset's files are read under a lock
        features = partial(_features, weakref.ref(self), self.mapped, map_name)
        return Network(map_name, features, self.traits(map_name))

    def traits(self, map_name: str) -> MapTraits | None:
        """What is known of a map without reading it; None for nothing."""
        found = self.mapped.traits(map_name)
        return MapTraits() if found is None and map_name not in self.manifest.maps else found

    def labels(self, frames: Iterable[str] | None = None) -> Iterator[Label]:
        """Labels in order of recording, time and frame, read in batches: memory does not grow with the dataset.

        For chosen frames only the row groups that hold them are read, each once.

        Args:
            frames: Only these frames; names that the dataset lacks are ignored. All by default.
        """
        wanted = None if frames is None else frozenset(frames)
        parts = list(zip(*(self.files(table) for table in ("labels", "objects", "sensors")), strict=True))
        with self.blamed():
            rows = None if wanted is None else find_rows(self.files("frame_index"), wanted)
            yield from read_labels(parts, rows, wanted, recorded=self.recorded)

    @contextmanager
    def blamed(self) -> Generator[None]:
        """Turn errors in the block that a changed file causes into one that names the file.

        A damaged file makes its decoder fail in many ways, and later code in many more. So the files are looked at
        when something has failed, and only then.

        Raises:
            DataError: `store-damaged` in place of another error, where a file is not as it was written;
                `store-unreachable` where it could not be read.
        """
        try:
            yield
        except (ScenicqError, MemoryError):
            raise
        except Exception as error:
            # what has failed may be the loading of DuckDB, which tried twice may end the process
            duckdb = sys.modules.get("duckdb")
            of_files = (OSError, ValueError) if duckdb is None else (duckdb.Error, OSError, ValueError)
            failure = self.place.failure()
            if failure is not None:
                raise failure from error
            if self.folder is not None:
                self.verify()
            elif isinstance(error, of_files):
                message = f"{self.name} cannot be read: {' '.join(str(error).split())}"
                hint = f"`scenicq info {self.name} --verify` reads all of it and names the files that have changed"
                raise DataError(Diagnostic("store-damaged", message, hints=(hint,))) from error
            raise

    def label(self, frame: str) -> Label:
        """Read the label of a frame; the beginning of its name will do if no other frame begins so.

        Raises:
            DataError: option-invalid: there is no such frame, or there are several.
        """
        for label in self.labels([frame]):
            return label
        with closing(self.connect()) as connection, self.blamed():
            name = find_frame(connection, frame)
        return next(self.labels([name]))

    def short_names(self) -> ShortNames:
        """Make the functions that cut names of frames and recordings; the short names are still found."""
        with closing(self.connect()) as connection, self.blamed():
            return name_shorteners(connection)

    def labels_at(self, part: int, first: int, end: int, *, motion: bool = True) -> Iterator[Label]:
        """Read a range of labels of one part, in order, as matching sees them: without heights, tilts and cameras.

        Args:
            part: Number of the part.
            first: Row of its labels to begin with.
            end: Row to end before.
            motion: Whether the observed motion is read, too.
        """
        return self.labels_in(part, np.arange(first, end), motion=motion)

    def labels_in(self, part: int, rows: NDArray[np.int64], *, motion: bool = True) -> Iterator[Label]:
        """Read some labels of one part, in order, as `labels_at` does.

        Args:
            part: Number of the part.
            rows: Rows of its labels, in order.
            motion: Whether the observed motion is read, too.
        """
        labels, objects, sensors = (self.files(table)[part] for table in ("labels", "objects", "sensors"))
        with self.blamed():
            yield from read_labels(
                [(labels, objects, sensors)], rows, None, motion=motion, space=False, recorded=self.recorded
            )

    def verify(self) -> None:
        """Compare every file with its checksum.

        Raises:
            DataError: `store-damaged`, one diagnostic a file.
        """
        problems: list[Diagnostic] = []
        for part in (part for parts in self.manifest.tables.values() for part in parts):
            if told := self.place.problems([part]):
                problems += told
            elif self.place.checksum(part) != part.sha256:
                problems.append(Diagnostic("store-damaged", f"{part.path} has changed since it was written"))
        if problems:
            raise DataError(list(dict.fromkeys(problems)))


def _files(place: Place, manifest: Manifest, table: str) -> tuple[StoreFile, ...]:
    return tuple(map(place.file, manifest.tables[table]))


def _features(opened: weakref.ref[Dataset], mapped: MapFiles, map_name: str) -> tuple[MapFeature, ...]:
    """The elements of a map of a dataset, which may not be open any more."""
    dataset = opened()
    return mapped.features(map_name) if dataset is None else dataset.features(map_name)


def open_dataset(address: str | Path, *, older: bool = False, check: bool = True) -> Dataset:
    """Open a dataset.

    Args:
        address: A folder, or what fsspec understands, such as `s3://bucket/dataset`.
        older: Whether a dataset of an older version is opened, too; it can only be brought up to date (`rebuild`).
        check: Whether to read all of it and refuse a dataset that is not sound. Leave it out only where the dataset is
            known to be sound: what readers do with another is not defined.

    Raises:
        DataError: `store-missing`, `store-version`, or `store-damaged` where a file is missing or has another size;
            `dataset-invalid` where the tables hold what no dataset may;
            `option-invalid` where a package for the address is not installed.
    """
    place = find_place(address)
    manifest = read_manifest(place.name, place.manifest(), older=older)
    problems = place.problems(part for parts in manifest.tables.values() for part in parts)
    if problems:
        raise DataError(problems)
    dataset = Dataset(place, manifest)
    if check:
        from scenicq.store.soundness import check_dataset  # noqa: PLC0415 - takes long to load

        try:
            with dataset.blamed():
                check_dataset(place, manifest)
        except DataError:
            dataset.verify()  # a file that was damaged since is another matter
            raise
    return dataset
