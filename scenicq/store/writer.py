"""Writing a dataset: beside its target, then renamed, so that a target is a whole dataset or nothing.

The same recordings and maps give byte-identical files but for the manifest's `provenance`.
"""

from __future__ import annotations

import os
import shutil
import socket
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from glob import escape
from pathlib import Path
from typing import Any

from scenicq.errors import DataError, Diagnostic
from scenicq.geometry.features import MapFeature
from scenicq.store.columns import recording_rows
from scenicq.store.labels import Recording
from scenicq.store.manifest import MANIFEST, Counts, LeftOut, Manifest, is_dataset
from scenicq.store.parquet import TableWriter, sync_folder, write_synced
from scenicq.store.placement import MapIndex
from scenicq.store.regions import lane_rows, region_rows
from scenicq.store.schema import SCHEMAS, ArrowTable

__all__ = ["DatasetWriter", "check_target", "write_dataset"]


class DatasetWriter:
    """Writes one dataset, recording by recording, as a context manager.

    Leaving the context before `finish`, for whatever reason, removes everything that was written.

    Example:
        with DatasetWriter(target, maps) as writer:
            for recording in recordings:
                writer.add(recording)
            manifest = writer.finish(name="mine")
    """

    def __init__(self, target: str | Path, maps: Mapping[str, Sequence[MapFeature]], *, force: bool = False) -> None:
        """Check the target; nothing is written yet.

        Args:
            target: Folder of the dataset to be.
            maps: Elements of each map.
            force: Whether a dataset that is there already may be replaced.

        Raises:
            DataError: `target-exists`; a folder that is not a dataset of ours is never replaced.
        """
        self._target = Path(target)
        self._maps = maps
        self._force = force
        check_target(self._target, force=self._force)
        mark = f"{socket.gethostname()}-{os.getpid()}"
        self._partial = self._target.with_name(f".{self._target.name}.partial-{mark}")
        self._aside = self._target.with_name(f".{self._target.name}.replaced-{mark}")
        self._tables: dict[str, TableWriter] = {}
        self._indexes: dict[str, MapIndex] = {}
        self._last = ""
        self._tracks = 0
        self._span: tuple[int, int] | None = None
        self._by_class: Counter[str] = Counter()
        self._by_source_class: Counter[str] = Counter()
        self._by_recording: dict[str, Counts] = {}
        self._by_map: defaultdict[str, list[Counts]] = defaultdict(list)

    def __enter__(self) -> DatasetWriter:
        """Open the files.

        Raises:
            DataError: `target-unwritable`, or `target-exists` where an interrupted replacement was undone.
        """
        try:
            _recover(self._target)
            check_target(self._target, force=self._force)
            self._partial.mkdir()
            for table in SCHEMAS:
                self._tables[table] = TableWriter(self._partial, table)
        except OSError as error:
            self._clean()
            raise self._unwritable(error) from error
        except BaseException:
            self._clean()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        """Remove what is not finished."""
        self._clean()

    def prepare(self, recording: Recording) -> dict[str, ArrowTable]:
        """Rows of a recording. May run in several threads, since it changes nothing that `add` reads."""
        return recording_rows(recording, self.index(recording.map))

    def index(self, map_name: str) -> MapIndex:
        """The prepared map; empty where there is no such map."""
        if map_name not in self._indexes:
            self._indexes[map_name] = MapIndex(map_name, self._maps.get(map_name, ()))
        return self._indexes[map_name]

    def add(self, recording: Recording, rows: Mapping[str, ArrowTable] | None = None) -> None:
        """Append a recording.

        Args:
            recording: With labels in order of time, then of frame; recordings come in order of their names.
            rows: What `prepare` gave for it; computed here by default.

        Raises:
            ValueError: The order is broken.
            DataError: `target-unwritable`.
        """
        if recording.name <= self._last and self._by_recording:
            raise ValueError(f"recording {recording.name!r} comes after {self._last!r}")
        keys = [(label.timestamp_us, label.frame) for label in recording.labels]
        if keys != sorted(keys):
            raise ValueError(f"the labels of recording {recording.name!r} are not in order of time")
        self._last = recording.name
        rows = self.prepare(recording) if rows is None else rows
        try:
            for table, content in rows.items():
                self._tables[table].add(content)
        except OSError as error:
            raise self._unwritable(error) from error
        self._count(recording)

    def finish(
        self,
        *,
        name: str,
        importer: str = "",
        left_out: Iterable[LeftOut] = (),
        provenance: Mapping[str, Any] | None = None,
    ) -> Manifest:
        """Write the maps and the manifest, and give the dataset its name.

        Raises:
            DataError: `target-unwritable`, or `target-exists` where something came into the way meanwhile.
        """
        try:
            self._tables["regions"].add(region_rows(self._maps))
            self._tables["lanes"].add(lane_rows(self._maps))
            parts = {table: (writer.finish(),) for table, writer in self._tables.items()}
            self._tables.clear()
            manifest = Manifest(
                name=name,
                importer=importer,
                tables=parts,
                maps={key: len(self._maps[key]) for key in sorted(self._maps)},
                total=_sum(self._by_recording.values()),
                tracks=self._tracks,
                span_us=self._span,
                by_class=dict(sorted(self._by_class.items())),
                by_source_class=dict(sorted(self._by_source_class.items())),
                by_map={key: _sum(self._by_map[key]) for key in sorted(self._by_map)},
                by_recording=self._by_recording,
                left_out=tuple(left_out),
                provenance=dict(provenance or {}),
            )
            write_synced(self._partial / MANIFEST, manifest.to_json())
            self._put_in_place()
        except OSError as error:
            raise self._unwritable(error) from error
        return manifest

    def _count(self, recording: Recording) -> None:
        objects = [member for label in recording.labels for member in label.objects]
        counts = Counts(len(recording.labels), len(objects))
        self._by_recording[recording.name] = counts
        self._by_map[recording.map].append(counts)
        self._by_class.update(member.category for member in objects)
        self._by_source_class.update(member.source_class for member in objects)
        self._tracks += len({member.track for member in objects} - {None})
        times = [label.timestamp_us for label in recording.labels]
        self._span = min([*times, *(self._span or ())]), max([*times, *(self._span or ())])

    def _put_in_place(self) -> None:
        check_target(self._target, force=self._force)
        replaces = self._target.exists()
        if replaces:
            self._target.rename(self._aside)
        try:
            self._partial.rename(self._target)
        except BaseException:
            if replaces:
                self._aside.rename(self._target)
            raise
        sync_folder(self._target.parent)
        shutil.rmtree(self._aside, ignore_errors=True)

    def _clean(self) -> None:
        for writer in self._tables.values():
            with suppress(OSError):
                writer.abandon()
        self._tables.clear()
        shutil.rmtree(self._partial, ignore_errors=True)

    def _unwritable(self, error: OSError) -> DataError:
        return DataError(
            Diagnostic("target-unwritable", f"{self._target} cannot be written: {error.strerror or error}")
        )


def check_target(target: Path, *, force: bool = False) -> None:
    """Refuse a target that must not be written.

    Args:
        target: Folder of the dataset to be.
        force: Whether a dataset that is there already may be replaced.

    Raises:
        DataError: `target-exists`, or `target-unwritable` for a path without a name of its own.
    """
    if not target.name or target.name == "..":
        raise DataError(Diagnostic("target-unwritable", f"{target} is not the name of a new folder"))
    if not os.path.lexists(target):
        return
    if not is_dataset(target):
        hint = "choose another name: only a dataset can be replaced"
        raise DataError(Diagnostic("target-exists", f"{target} exists and is not a dataset of scenicq", hints=(hint,)))
    if not force:
        raise DataError(Diagnostic("target-exists", f"the dataset {target} exists", hints=("`--force` replaces it",)))


def write_dataset(
    target: str | Path,
    recordings: Iterable[Recording],
    maps: Mapping[str, Sequence[MapFeature]],
    *,
    name: str,
    force: bool = False,
) -> Manifest:
    """Write a dataset from values in memory.

    Args:
        target: Folder of the dataset to be.
        recordings: In order of their names.
        maps: Elements of each map that the recordings refer to.
        name: What the dataset is called.
        force: Whether a dataset that is there already may be replaced.

    Raises:
        DataError: `target-exists` or `target-unwritable`.
        ValueError: The order is broken.
    """
    with DatasetWriter(target, maps, force=force) as writer:
        for recording in recordings:
            writer.add(recording)
        return writer.finish(name=name)


def _sum(counts: Iterable[Counts]) -> Counts:
    every = list(counts)
    return Counts(sum(count.frames for count in every), sum(count.objects for count in every))


def _recover(target: Path) -> None:
    """Undo what a process of this machine left behind when it was killed in the middle."""
    for folder in target.parent.glob(f".{escape(target.name)}.*-{escape(socket.gethostname())}-*"):
        kind, _, process = folder.name.removeprefix(f".{target.name}.").partition(f"-{socket.gethostname()}-")
        if not process.isdecimal() or _is_running(int(process)):
            continue
        if kind == "replaced" and not target.exists():
            folder.rename(target)
        elif kind in ("partial", "replaced"):
            shutil.rmtree(folder, ignore_errors=True)


def _is_running(process: int) -> bool:
    if os.name != "posix":
        return True  # signal 0 would end it on other systems
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
