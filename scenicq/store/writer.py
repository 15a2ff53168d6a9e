"""Write a dataset beside its target, then move it there, so that the target is a whole dataset or nothing.

The same recordings and maps give byte-identical files but for the manifest's `provenance`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.store.atomic_files import write_whole
from scenicq.store.columns import RecordingColumns, columns_of
from scenicq.store.frame_index import frame_hashes, index_rows, repeated_rows
from scenicq.store.labels import Recording
from scenicq.store.manifest import MANIFEST, Counts, Manifest, MapGroup, Omission, Provenance
from scenicq.store.parquet import TableWriter
from scenicq.store.partial import Partial, check_target
from scenicq.store.schema import SCHEMAS, SEGMENT_TABLES, ArrowTable
from scenicq.store.segment import SEGMENT_OBJECTS, MapIndexes, Segment, SegmentWriter, read_segments, take_over

if TYPE_CHECKING:
    from scenicq.geometry.features import MapFeature

__all__ = ["DatasetWriter", "write_dataset"]

_MAP_ROWS = 512
"""Fewest rows of a row group of maps that is followed by another: fewer are read as fast as these."""


class DatasetWriter:
    """Writes one dataset, recording by recording or segment by segment, as a context manager.

    Leaving the context before `finish`, for whatever reason, removes everything that was written.

    Example:
        with DatasetWriter(target, maps) as writer:
            for recording in recordings:
                writer.add(recording)
            manifest = writer.finish(name="mine")
    """

    def __init__(
        self,
        target: str | Path,
        maps: Mapping[str, Sequence[MapFeature]],
        *,
        force: bool = False,
        update: bool = False,
        segment_objects: int = SEGMENT_OBJECTS,
    ) -> None:
        """Check the target; nothing is written yet.

        Args:
            target: Folder of the dataset to be.
            maps: Elements of each map; the attribute may be set anew until something is added.
            force: Whether a dataset that is there already may be replaced, and what a killed process left is no use.
            update: Whether a dataset that is there already may be replaced by one with more in it.
            segment_objects: Label objects after which `add` begins another part of the tables.

        Raises:
            DataError: `target-exists`; a folder that is not a dataset of ours is never replaced.
        """
        self._target = Path(target)
        self.maps = maps
        self._force, self._update = force, update
        self._segment_objects = segment_objects
        self._partial = Partial(self._target)
        self._segments: dict[int, Segment] = {}
        self._indexes = MapIndexes(maps)
        self._open: SegmentWriter | None = None
        self._last = ""
        self._hashed: tuple[list[Segment], NDArray[np.uint64]] = [], np.empty(0, np.uint64)
        self.left: dict[int, Segment] = {}
        check_target(self._target, force=force, update=update)

    @property
    def folder(self) -> Path:
        """Where the dataset grows; other processes may write segments there."""
        return self._partial.folder

    @property
    def segments(self) -> list[Segment]:
        """The segments that are complete, in order."""
        return [self._segments[number] for number in sorted(self._segments)]

    def __enter__(self) -> DatasetWriter:
        """Take the place.

        `left` then holds the complete segments that a killed process left, by number; none with `force`.

        Raises:
            DataError: `target-unwritable`, or `target-exists` where an interrupted replacement was undone or another
                process writes.
        """
        try:
            self._partial.open()
            check_target(self._target, force=self._force, update=self._update)
            if self._force:
                self._partial.clear()
            self.left = read_segments(self.folder)
        except OSError as error:
            self._partial.remove()
            raise self.unwritable(error) from error
        except BaseException:
            self._partial.remove()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        """Remove what is not finished."""
        if self._open is not None:
            self._open.abandon()
        self._partial.remove()

    def add(self, recording: Recording | RecordingColumns) -> None:
        """Append a recording.

        Args:
            recording: With labels in order of time, then of frame; recordings come in order of their names.

        Raises:
            ValueError: The order is broken.
            DataError: `target-unwritable`.
        """
        if recording.name <= self._last and self._last:
            raise ValueError(f"recording {recording.name!r} comes after {self._last!r}")
        columns = columns_of(recording) if isinstance(recording, Recording) else recording
        keys = list(zip(columns.times_us, columns.frames, strict=True))
        if keys != sorted(keys):
            raise ValueError(f"the labels of recording {recording.name!r} are not in order of time")
        self._last = recording.name
        try:
            if self._open is not None and self._open.objects + len(columns.objects.x) > self._segment_objects:
                self._close_segment()
            if self._open is None:
                self._open = SegmentWriter(self.folder, len(self._segments))
                self._open.open()
            self._open.add(columns, self._indexes.of(columns.map))
        except OSError as error:
            raise self.unwritable(error) from error

    def adopt(self, number: int, segment: Segment, source: tuple[Path, int] | None = None) -> None:
        """Count in a segment.

        Args:
            number: Its number; in the end they are 0, 1, 2 ... in the order of their recordings.
            segment: What it holds.
            source: Dataset and number where its files are; they are at their place already by default.

        Raises:
            DataError: `target-unwritable`.
        """
        if source is not None:
            try:
                take_over(segment, *source, self.folder, number)
            except OSError as error:
                raise self.unwritable(error) from error
        self._segments[number] = segment

    def repeated_frames(self) -> list[tuple[int, str, str]]:
        """Label rows with a frame that occurs in a segment before: number of the segment, recording, frame."""
        rows = repeated_rows(self._hashes()).tolist()
        seen: set[str] = set()
        repeated: list[tuple[int, str, str]] = []
        start = 0
        for number in sorted(self._segments) if rows else ():
            size = self._segments[number].files["labels"].rows
            inside = [row - start for row in rows if start <= row < start + size]
            start += size
            if inside:
                table = self._read(number, ["recording", "frame"]).take(inside)
                for recording, frame in zip(*(column.to_pylist() for column in table.columns), strict=True):
                    if frame in seen:
                        repeated.append((number, recording, frame))
                    seen.add(frame)
        return repeated

    def finish(
        self,
        *,
        name: str,
        importer: str = "",
        left_out: Iterable[Omission] = (),
        provenance: Provenance | None = None,
    ) -> Manifest:
        """Write the maps, the index and the manifest, and give the dataset its name.

        Raises:
            DataError: `target-unwritable`, or `target-exists` where something came into the way meanwhile.
        """
        try:
            if self._open is not None:
                self._close_segment()
            segments = self.segments
            tables = {table: tuple(s.part(table, n) for n, s in enumerate(segments)) for table in SEGMENT_TABLES}
            for table, pieces in {**self._map_rows(), "frame_index": [index_rows(self._hashes())]}.items():
                writer = TableWriter(self.folder, table)
                for rows in pieces:
                    writer.add(rows)
                    writer.end_group(_MAP_ROWS)
                tables[table] = (writer.finish(),)
            manifest = Manifest(
                name=name,
                importer=importer,
                tables={table: tables[table] for table in SCHEMAS},
                maps={key: len(self.maps[key]) for key in sorted(self.maps)},
                map_groups=self._map_groups(),
                left_out=tuple(left_out),
                provenance=provenance or Provenance(),
                **_totals(segments),
            )
            write_whole(self.folder / MANIFEST, manifest.to_json())
            parts = [Path(part.path) for files in tables.values() for part in files]
            about = [Path("segments") / f"part-{number:05}.json" for number in range(len(segments))]
            self._partial.keep([*parts, *about, Path(MANIFEST)])
            check_target(self._target, force=self._force, update=self._update)
            self._partial.put_in_place()
        except OSError as error:
            raise self.unwritable(error) from error
        return manifest

    def unwritable(self, error: OSError) -> DataError:
        """The error that says that the target cannot be written."""
        return DataError(
            Diagnostic("target-unwritable", f"{self._target} cannot be written: {error.strerror or error}")
        )

    def _map_groups(self) -> tuple[MapGroup, ...]:
        """What is known of the maps without reading them."""
        if not any(self.maps.values()):
            return ()
        from scenicq.store.regions import map_groups  # noqa: PLC0415 - slow to load, and for maps

        return map_groups(self.maps)

    def _map_rows(self) -> dict[str, Iterable[ArrowTable]]:
        """The rows of the tables of maps, map by map: each map shares row groups with few others."""
        if not any(self.maps.values()):
            return {"regions": (), "lanes": (), "links": ()}
        from scenicq.store.regions import lane_rows, link_rows, region_rows  # noqa: PLC0415 - slow to load, and for maps

        return {
            "regions": (region_rows(name, self.maps[name]) for name in sorted(self.maps)),
            "lanes": (lane_rows(name, self.maps[name]) for name in sorted(self.maps)),
            "links": (link_rows(name, self.maps[name]) for name in sorted(self.maps)),
        }

    def _close_segment(self) -> None:
        assert self._open is not None
        self._segments[len(self._segments)] = self._open.finish()
        self._open = None

    def _hashes(self) -> NDArray[np.uint64]:
        """The hash of the frames of all segments, in order; kept, as most datasets are asked for it twice."""
        segments = self.segments
        if self._hashed[0] != segments:
            numbers = sorted(self._segments)
            hashes = [frame_hashes(self._read(number, ["frame"])["frame"].to_pylist()) for number in numbers]
            self._hashed = segments, np.concatenate([np.empty(0, np.uint64), *hashes])
        return self._hashed[1]

    def _read(self, number: int, columns: list[str]) -> ArrowTable:
        with pq.ParquetFile(self.folder / self._segments[number].part("labels", number).path) as file:
            return file.read(columns=columns, use_threads=False)


def write_dataset(
    target: str | Path,
    recordings: Iterable[Recording | RecordingColumns],
    maps: Mapping[str, Sequence[MapFeature]],
    *,
    name: str,
    force: bool = False,
    segment_objects: int = SEGMENT_OBJECTS,
) -> Manifest:
    """Write a dataset from values in memory.

    Args:
        target: Folder of the dataset to be.
        recordings: In order of their names.
        maps: Elements of each map that the recordings refer to.
        name: What the dataset is called.
        force: Whether a dataset that is there already may be replaced.
        segment_objects: Label objects after which another part of the tables begins.

    Raises:
        DataError: `target-exists` or `target-unwritable`.
        ValueError: The order is broken.
    """
    with DatasetWriter(target, maps, force=force, segment_objects=segment_objects) as writer:
        for recording in recordings:
            writer.add(recording)
        return writer.finish(name=name)


def _totals(segments: Sequence[Segment]) -> dict[str, Any]:
    """The fields of a manifest that add up over segments."""
    by_class: Counter[str] = Counter()
    by_source_class: Counter[str] = Counter()
    by_map: dict[str, Counts] = {}
    for segment in segments:
        by_class.update(segment.by_class)
        by_source_class.update(segment.by_source_class)
        for name, counts in segment.by_map.items():
            by_map[name] = _sum((by_map.get(name, Counts()), counts))
    by_recording = {
        name: Counts(counts.frames, counts.objects)
        for segment in segments
        for name, counts in segment.recordings.items()
    }
    times = [time for segment in segments for time in segment.span_us or ()]
    return {
        "total": _sum(by_recording.values()),
        "tracks": sum(segment.tracks for segment in segments),
        "span_us": (min(times), max(times)) if times else None,
        "by_class": dict(sorted(by_class.items())),
        "by_source_class": dict(sorted(by_source_class.items())),
        "by_map": dict(sorted(by_map.items())),
        "by_recording": by_recording,
    }


def _sum(counts: Iterable[Counts]) -> Counts:
    every = list(counts)
    return Counts(sum(count.frames for count in every), sum(count.objects for count in every))
