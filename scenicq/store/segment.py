"""Segments: runs of recordings that are written, kept and taken over as one.

A segment has one Parquet file in each of the four large tables and a small JSON file that says what it holds. That file
is written last, so a segment is there completely or not at all. Segments depend on nothing but their own recordings and
maps; therefore processes write them side by side, and an interrupted or repeated ingest takes them over as they are.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import pyarrow as pa
from msgspec import Struct

from scenicq.recent import Recent
from scenicq.store.atomic_files import write_whole
from scenicq.store.columns import RecordingColumns
from scenicq.store.manifest import SEGMENTS, Counts, Part, Whole
from scenicq.store.parquet import TableWriter, part_path
from scenicq.store.rows import recording_rows
from scenicq.store.schema import SEGMENT_TABLES, ArrowTable

if TYPE_CHECKING:  # slow to load, and not every source has maps
    from scenicq.geometry.features import MapFeature
    from scenicq.store.map_index import MapIndex

__all__ = [
    "SEGMENT_OBJECTS",
    "MapIndexes",
    "Segment",
    "SegmentWriter",
    "SourceProblem",
    "SourceRecording",
    "is_whole",
    "read_segments",
    "segments_of",
    "take_over",
]

SEGMENT_OBJECTS = 1 << 20
"""Upper bound of the label objects of a segment, unless a single recording has more."""


class SourceProblem(Struct, frozen=True):
    """A problem of the source, as the importer's report told it.

    Attributes:
        what, code, name, kept: As in `Omission`.
        message, hints: The diagnostic's.
    """

    what: str
    code: str
    name: str
    kept: bool
    message: str
    hints: tuple[str, ...] = ()


class SourceRecording(Struct, frozen=True):
    """What one recording of the source became.

    Attributes:
        fingerprint: Changes with everything that the recording was made from; "" where nobody asks.
        counts: How often each problem occurred: what, code, name, kept, count.
        told: The first problems of each kind.
        maps: The map that it is on, with what changes with any element of it, "" where it is not there; none where
            nothing came of the recording.
    """

    fingerprint: str
    counts: tuple[tuple[str, str, str, bool, int], ...] = ()
    told: tuple[SourceProblem, ...] = ()
    maps: tuple[tuple[str, str], ...] = ()


class SegmentFile(Struct, frozen=True, array_like=True):
    """Size, checksum and rows of a Parquet file."""

    bytes: Whole
    sha256: str
    rows: Whole


class CountsRow(Counts, frozen=True, array_like=True):
    """Counts that are written as a pair."""


class Segment(Struct, frozen=True):
    """What one segment holds.

    Attributes:
        fingerprint: Changes with everything that the segment was made from; "" where nobody asks.
        files: Size, checksum and rows of its file in each table; the paths are those of its number.
        recordings: Frames and label objects of each recording, in order.
        rows: Rows of each recording in each of `SEGMENT_TABLES`, in order.
        by_map: Frames and label objects of each map.
        by_class, by_source_class: Label objects of each class.
        tracks: Distinct tracks, counted within each recording.
        span_us: First and last timestamp; None without frames.
        pieces: What each recording of the source became, in order, those of which nothing came, too.
    """

    fingerprint: str
    files: dict[str, SegmentFile]
    recordings: dict[str, CountsRow]
    by_map: dict[str, CountsRow]
    by_class: dict[str, Whole]
    by_source_class: dict[str, Whole]
    tracks: Whole
    span_us: tuple[int, int] | None
    rows: dict[str, list[Whole]] = {}
    pieces: dict[str, SourceRecording] = {}

    @property
    def objects(self) -> int:
        """Label objects."""
        return sum(counts.objects for counts in self.recordings.values())

    def part(self, table: str, number: int) -> Part:
        """The segment's file in a table, if it has that number."""
        file = self.files[table]
        return Part(part_path(table, number, file.sha256), file.bytes, file.sha256, file.rows)


def segments_of(weights: Sequence[tuple[str, int]], largest: int = SEGMENT_OBJECTS) -> Iterator[list[str]]:
    """Group recordings into segments.

    Where one ends is drawn by the names of the recordings once it has a quarter of the largest size. So a recording
    that comes in between changes the segments near it and leaves the others as they are.

    Args:
        weights: Name and number of label objects (or an estimate) of each recording, in order.
        largest: Most label objects of a segment of several recordings.
    """
    segment: list[str] = []
    total = 0
    for name, weight in weights:
        drawn = int.from_bytes(hashlib.blake2b(name.encode(), digest_size=4).digest()) / 2**32
        if segment and (total + weight > largest or (4 * total >= largest and drawn * largest < 4 * weight)):
            yield segment
            segment, total = [], 0
        segment.append(name)
        total += weight
    if segment:
        yield segment


_MAPS_KEPT = 8
"""Maps of which an index is kept: sources with few maps have their recordings in any order."""


class MapIndexes:
    """Indexes of maps, each made when it is asked for; the last few are kept."""

    def __init__(self, maps: Mapping[str, Sequence[MapFeature]]) -> None:
        """Take the elements of each map."""
        self._maps = maps
        self._made: Recent[str, MapIndex] = Recent(_MAPS_KEPT)

    def of(self, name: str) -> MapIndex | None:
        """The index of a map; None if it has no elements."""
        if not self._maps.get(name):
            return None
        from scenicq.store.map_index import MapIndex  # noqa: PLC0415 - slow to load, and for maps

        return self._made.get(name, lambda: MapIndex(self._maps[name]))


class _Tally(NamedTuple):
    """What is counted of a recording: objects of each class, tracks, and the times of its labels."""

    classes: Counter[str]
    source_classes: Counter[str]
    tracks: int
    times_us: Sequence[int]


@dataclass(slots=True)
class SegmentWriter:
    """Writes one segment of a dataset.

    Attributes:
        folder: The dataset's folder.
        number: The segment's number.
    """

    folder: Path
    number: int
    _tables: dict[str, TableWriter] = field(default_factory=dict[str, TableWriter])
    _recordings: dict[str, CountsRow] = field(default_factory=dict[str, CountsRow])
    _by_map: dict[str, CountsRow] = field(default_factory=dict[str, CountsRow])
    _by_class: Counter[str] = field(default_factory=Counter[str])
    _by_source_class: Counter[str] = field(default_factory=Counter[str])
    _rows: dict[str, list[int]] = field(default_factory=dict[str, list[int]])
    _tracks: int = 0
    _times: list[int] = field(default_factory=list[int])

    def open(self) -> None:
        """Open the files.

        Raises:
            OSError: The folder cannot be written.
        """
        # What an earlier process said of this number is not true of the files from here on.
        _description(self.folder, self.number).unlink(missing_ok=True)
        for table in SEGMENT_TABLES:
            self._tables[table] = TableWriter(self.folder, table, self.number)

    def add(self, columns: RecordingColumns, index: MapIndex | None) -> None:
        """Append a recording with its map, if it has one; they come in order of their names.

        Raises:
            OSError: The folder cannot be written.
        """
        tables = self._tables
        first = {"first_object": tables["objects"].rows, "first_sensor": tables["sensors"].rows}
        objects = columns.objects
        tally = _Tally(
            Counter(objects.category), Counter(objects.source_class), len({*objects.track} - {None}), columns.times_us
        )
        rows = recording_rows(columns, index, **first)
        self._append({columns.name: [len(rows[table]) for table in SEGMENT_TABLES]}, rows, tally)

    def copy(self, recordings: Mapping[str, Sequence[int]], rows: Mapping[str, ArrowTable]) -> None:
        """Append recordings that lie one after the other in another segment.

        Args:
            recordings: How many rows each has in each of `SEGMENT_TABLES`; recordings come in order of their names.
            rows: The rows of all in each of `SEGMENT_TABLES`.

        Raises:
            OSError: The folder cannot be written.
        """
        import pyarrow.compute as pc  # noqa: PLC0415 - takes longer to load than a small ingest does

        labels, objects = rows["labels"], rows["objects"]
        for column, table in (("first_object", "objects"), ("first_sensor", "sensors")):
            place = labels.schema.get_field_index(column)
            first = labels[column][0] if len(labels) else 0
            moved = pc.add(pc.subtract(labels[column], first), pa.scalar(self._tables[table].rows, pa.int32()))
            labels = labels.set_column(place, labels.schema.field(place), moved)
        classes, source_classes = (
            Counter({each["values"]: each["counts"] for each in objects[column].value_counts().to_pylist()})
            for column in ("class", "source_class")
        )
        tracks = objects.select(["recording", "track"]).filter(pc.field("track").is_valid())
        distinct = len(tracks.group_by(["recording", "track"], use_threads=False).aggregate([]))
        tally = _Tally(classes, source_classes, distinct, labels["timestamp_us"].to_pylist())
        self._append(recordings, {**rows, "labels": labels}, tally)

    def _append(self, recordings: Mapping[str, Sequence[int]], rows: Mapping[str, ArrowTable], tally: _Tally) -> None:
        for table in SEGMENT_TABLES:
            self._tables[table].add(rows[table])
        labels, first = rows["labels"], 0
        for name, sizes in recordings.items():
            by_table = dict(zip(SEGMENT_TABLES, sizes, strict=True))
            counts = CountsRow(by_table["labels"], by_table["objects"])
            self._recordings[name] = counts
            self._rows[name] = list(sizes)
            map_name = labels["map"][first].as_py() if counts.frames else ""
            before = self._by_map.get(map_name, CountsRow())
            self._by_map[map_name] = CountsRow(before.frames + counts.frames, before.objects + counts.objects)
            first += counts.frames
        self._by_class += tally.classes
        self._by_source_class += tally.source_classes
        self._tracks += tally.tracks
        ends = [*self._times, *tally.times_us]
        self._times = [min(ends), max(ends)] if ends else []

    @property
    def objects(self) -> int:
        """Label objects so far."""
        return self._tables["objects"].rows if self._tables else 0

    def finish(self, fingerprint: str = "", pieces: Mapping[str, SourceRecording] | None = None) -> Segment:
        """Complete the files, then say so.

        Args:
            fingerprint: The segment's fingerprint.
            pieces: As in `Segment`.

        Raises:
            OSError: The folder cannot be written.
        """
        segment = Segment(
            fingerprint=fingerprint,
            files={table: _file(writer.finish()) for table, writer in self._tables.items()},
            recordings=self._recordings,
            by_map=dict(sorted(self._by_map.items())),
            by_class=dict(sorted(self._by_class.items())),
            by_source_class=dict(sorted(self._by_source_class.items())),
            tracks=self._tracks,
            span_us=(self._times[0], self._times[1]) if self._times else None,
            rows=self._rows,
            pieces=dict(pieces or {}),
        )
        self._tables.clear()
        (self.folder / SEGMENTS).mkdir(exist_ok=True)
        write_whole(_description(self.folder, self.number), msgspec.json.encode(segment).decode() + "\n")
        return segment

    def abandon(self) -> None:
        """Close and remove what is not finished."""
        for writer in self._tables.values():
            with suppress(OSError):
                writer.abandon()
        self._tables.clear()


def read_segments(folder: Path) -> dict[int, Segment]:
    """The complete segments of a dataset, finished or not, by number; damaged ones are passed over."""
    found: dict[int, Segment] = {}
    for path in sorted((folder / SEGMENTS).glob("part-*.json")):
        try:
            number = int(path.stem.removeprefix("part-"))
            segment = msgspec.json.decode(path.read_bytes(), type=Segment)
            parts = [segment.part(table, number) for table in SEGMENT_TABLES]
            if all((folder / part.path).stat().st_size == part.bytes for part in parts):
                found[number] = segment
        except (OSError, ValueError, KeyError, RecursionError, msgspec.DecodeError):
            continue
    return found


def is_whole(segment: Segment, folder: Path, number: int) -> bool:
    """Whether the files of a segment are as they were written, by their checksums.

    Args:
        segment: The segment.
        folder: The dataset's folder.
        number: The segment's number there.
    """
    for table in SEGMENT_TABLES:
        part = segment.part(table, number)
        try:
            with (folder / part.path).open("rb") as file:
                if hashlib.file_digest(file, "sha256").hexdigest() != part.sha256:
                    return False
        except OSError:
            return False
    return True


def take_over(segment: Segment, source: Path, number: int, target: Path, new_number: int) -> None:
    """Put the files of a segment into another dataset, without copying where the system can.

    Raises:
        OSError: A file cannot be read or written.
    """
    pairs = [
        (source / segment.part(table, number).path, target / segment.part(table, new_number).path)
        for table in SEGMENT_TABLES
    ]
    for old, new in [*pairs, (_description(source, number), _description(target, new_number))]:
        new.parent.mkdir(exist_ok=True)
        new.unlink(missing_ok=True)
        try:
            os.link(old, new)
        except OSError:
            shutil.copyfile(old, new)


def _file(part: Part) -> SegmentFile:
    return SegmentFile(part.bytes, part.sha256, part.rows)


def _description(folder: Path, number: int) -> Path:
    return folder / SEGMENTS / f"part-{number:05}.json"
