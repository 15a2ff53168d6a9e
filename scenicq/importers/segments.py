"""One segment of an ingest as a value, and the process that writes it.

What a segment holds depends on its job alone, so segments can be written here or there, now or in an earlier ingest.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from itertools import accumulate, groupby, pairwise
from operator import add, sub
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from msgspec import structs

from scenicq.errors import DataError, Diagnostic
from scenicq.garbage import pause_collector
from scenicq.importers.base import LabelChecker, RecordingEntry, RecordingReader
from scenicq.importers.recording_checks import check_recording
from scenicq.importers.report import MOST_MESSAGES, Report
from scenicq.processes import LostTask, Workers, default_processes
from scenicq.store.schema import SCHEMA_VERSION, SEGMENT_TABLES, ArrowTable
from scenicq.store.segment import MapIndexes, Segment, SegmentWriter, SourceRecording

if TYPE_CHECKING:
    from scenicq.geometry.features import MapFeature
    from scenicq.store.part_rows import PartRows

__all__ = [
    "Job",
    "RecordingTask",
    "SegmentPlace",
    "World",
    "fingerprint",
    "is_on_maps",
    "map_digests",
    "write_segments",
]

_MOST_MESSAGES = 10_000
"""Messages of the recordings of a segment that are kept for later ingests; what has more is read anew then."""

_COPIED = 65_536
"""Rows of a table that are copied at a time, but for those of one recording."""

OnRecording = Callable[[str, int], None]
"""Called with a recording and its number of frames when it is written."""
OnTold = Callable[[tuple[str, int]], None]
"""What a worker calls instead: its message is passed on to `OnRecording`."""


@dataclass(frozen=True, slots=True)
class World:
    """What all jobs of an ingest share.

    Attributes:
        folder: The folder of the dataset that grows.
        maps: Elements of each map.
        digests: What changes with any element of a map, by its name.
        strict: Whether the first problem is an error.
    """

    folder: Path
    maps: Mapping[str, Sequence[MapFeature]] = field(repr=False)
    digests: Mapping[str, str] = field(default_factory=dict[str, str], repr=False)
    strict: bool = False


@dataclass(frozen=True, slots=True)
class SegmentPlace:
    """Where a segment lies that there is already.

    Attributes:
        folder: The folder of its dataset.
        number: The segment's number there.
        segment: What it holds.
    """

    folder: Path
    number: int
    segment: Segment = field(repr=False)


@dataclass(frozen=True, slots=True)
class RecordingTask:
    """One recording of a segment to be written.

    Attributes:
        name: The recording's name.
        fingerprint: What changes with all that it depends on but its map.
        reader: Reads the recording alone.
        old: A segment that has it already.
    """

    name: str
    fingerprint: str
    reader: RecordingReader = field(repr=False)
    old: SegmentPlace | None = None


@dataclass(frozen=True, slots=True)
class Job:
    """One segment to be written.

    Attributes:
        number: The segment's number.
        shares: Its recordings, in order.
        fingerprint: What changes with all that it depends on but the maps of its recordings.
        taken: Recording and frame of labels that are left out, because earlier recordings use the same name.
    """

    number: int
    shares: tuple[RecordingTask, ...]
    fingerprint: str
    taken: frozenset[tuple[str, str]] = frozenset()


def fingerprint(context: Sequence[str], entries: Sequence[RecordingEntry], taken: frozenset[tuple[str, str]]) -> str:
    """What changes with everything that a segment, or a recording of it, depends on, but for their maps.

    Which map a recording is on is known when it is read (`is_on_maps`).

    Args:
        context: What all segments of an ingest depend on.
        entries: Its recordings.
        taken: As in `Job`.
    """
    content = [SCHEMA_VERSION, *context, [[entry.name, entry.digest] for entry in entries], sorted(taken)]
    return hashlib.blake2b(json.dumps(content).encode(), digest_size=16).hexdigest()


def map_digests(maps: Mapping[str, Sequence[MapFeature]]) -> dict[str, str]:
    """What changes with any element of a map, by the map's name."""
    if not maps:
        return {}
    import shapely  # noqa: PLC0415 - slow to load, and for maps

    found: dict[str, str] = {}
    for name, features in maps.items():
        digest = hashlib.blake2b(digest_size=16)
        shapes = shapely.to_wkb(np.array([feature.shape for feature in features], dtype=object))
        for feature, shape in zip(features, shapes, strict=True):
            digest.update(json.dumps([feature.id, feature.kind, dict(feature.properties)]).encode())
            digest.update(shape)
        found[name] = digest.hexdigest()
    return found


def is_on_maps(recordings: Iterable[SourceRecording], digests: Mapping[str, str]) -> bool:
    """Whether recordings were written with maps that are there, and what is not there was not.

    Args:
        recordings: What became of them.
        digests: The `map_digests` of what is there.
    """
    return all(digests.get(name, "") == digest for each in recordings for name, digest in each.maps)


def write_segments(
    world: World, jobs: Sequence[Job], at_once: int | None, on_recording: OnRecording
) -> Iterator[Segment]:
    """Write segments, here or in other processes; the files do not depend on where.

    Args:
        world: What the jobs share.
        jobs: In order.
        at_once: How many processes work side by side; with one it is this one, None for as many as pay.
        on_recording: Called in this process; what it raises ends the work.

    Yields:
        The segments in order of the jobs.

    Raises:
        DataError: A problem of the source where the ingest is strict, or processes died again and again.
        OSError: The folder cannot be written.
    """
    many = 1 if len(jobs) <= 1 else at_once
    if not many:
        many = default_processes()
    if many > 1:
        yield from _write_apart(world, jobs, many, on_recording)
        return
    indexes = MapIndexes(world.maps)
    for job in jobs:
        yield _write(world, job, indexes, on_recording)


def _write_apart(world: World, jobs: Sequence[Job], many: int, on_recording: OnRecording) -> Iterator[Segment]:
    """Write segments in so many processes."""
    workers: Workers[Job, Segment] = Workers(min(many, len(jobs)), _start_worker, (world,))
    known: set[tuple[str, int]] = set()

    def told(said: tuple[str, int]) -> None:
        if said not in known:  # a segment that is written again tells again
            known.add(said)
            on_recording(*said)

    with workers:
        for job, segment in workers.run(jobs, told):
            if isinstance(segment, LostTask):
                message = (
                    f"{segment.tries} processes that wrote the recordings from `{job.shares[0].name}` on were killed, "
                    "perhaps for want of memory"
                )
                raise DataError(Diagnostic("budget-exceeded", message, hints=("use fewer `--jobs`",)))
            yield segment


def _write(world: World, job: Job, indexes: MapIndexes, on_recording: OnRecording) -> Segment:
    writer = SegmentWriter(world.folder, job.number)
    pieces: dict[str, SourceRecording] = {}
    messages: Counter[tuple[str, str]] = Counter()
    try:
        with pause_collector(), closing(_OldRows()) as old:
            writer.open()
            for place, shares in groupby(job.shares, lambda share: share.old):
                together = list(shares)
                if place is None:
                    found = (_read(world, job, share, writer, indexes, on_recording) for share in together)
                else:
                    found = _copy([share.name for share in together], place, old, writer, on_recording)
                for share, piece in zip(together, found, strict=True):
                    pieces[share.name] = piece
                    if messages.total() > _MOST_MESSAGES:
                        few = tuple(each for each in piece.told if messages[each.what, each.code] < MOST_MESSAGES)
                        pieces[share.name] = structs.replace(piece, fingerprint="", told=few)
                    messages.update((each.what, each.code) for each in pieces[share.name].told)
            return writer.finish(job.fingerprint, pieces)
    finally:
        writer.abandon()


def _read(
    world: World, job: Job, share: RecordingTask, writer: SegmentWriter, indexes: MapIndexes, on_recording: OnRecording
) -> SourceRecording:
    """Read a recording from the source."""
    report = Report(strict=world.strict)
    maps: dict[str, str] = {}
    for found in share.reader.recordings(LabelChecker(world.maps.keys(), report, job.taken), report):
        check_recording(found, report)
        writer.add(found, indexes.of(found.map))
        on_recording(found.name, len(found.frames))
        maps[found.map] = world.digests.get(found.map, "")
    return SourceRecording(share.fingerprint, report.tally, report.problems, tuple(maps.items()))


def _copy(
    names: Sequence[str], place: SegmentPlace, old: _OldRows, writer: SegmentWriter, on_recording: OnRecording
) -> Iterator[SourceRecording]:
    """Take recordings from a segment that has them, or has found that nothing comes of them."""
    segment = place.segment
    for recordings, rows in old.runs(place, [name for name in names if name in segment.recordings]):
        writer.copy(recordings, rows)
        for name in recordings:
            on_recording(name, segment.recordings[name].frames)
    yield from (segment.pieces[name] for name in names)


class _OldRows:
    """Rows of segments that there are already, each read once and forwards; to be closed."""

    def __init__(self) -> None:
        self._open: dict[tuple[Path, int], dict[str, PartRows]] = {}
        self._first: dict[tuple[Path, int], dict[str, list[int]]] = {}
        self._files = ExitStack()

    def runs(
        self, place: SegmentPlace, names: Sequence[str]
    ) -> Iterator[tuple[dict[str, Sequence[int]], dict[str, ArrowTable]]]:
        """Recordings that lie one after the other, with the number of their rows in each table, and the rows.

        Args:
            place: A segment.
            names: Recordings of it, in order, behind those of earlier calls.
        """
        key, rows = (place.folder, place.number), place.segment.rows
        if key not in self._open:
            files = {table: place.segment.part(table, place.number).path for table in SEGMENT_TABLES}
            from scenicq.store.part_rows import PartRows  # noqa: PLC0415 - slow to load, and for updates

            tables = {table: PartRows(table, place.folder / path, path) for table, path in files.items()}
            self._open[key] = {table: self._files.enter_context(closing(each)) for table, each in tables.items()}
            firsts = accumulate(
                rows.values(), lambda first, counts: [*map(add, first, counts)], initial=[0] * len(tables)
            )
            self._first[key] = dict(zip(rows, map(list, firsts), strict=False))
        first = self._first[key]
        run: list[str] = []
        for name, following in pairwise([*names, None]):
            assert name is not None
            run.append(name)
            begin, end = first[run[0]], [*map(add, first[name], rows[name])]
            if following is None or first[following] != end or max(map(sub, end, begin)) > _COPIED:
                tables = zip(self._open[key].items(), begin, map(sub, end, begin), strict=True)
                yield (
                    {each: rows[each] for each in run},
                    {table: there.take(start, count) for (table, there), start, count in tables},
                )
                run = []

    def close(self) -> None:
        """Close all files."""
        self._files.close()


def _start_worker(world: World) -> Callable[[Job, OnTold], Segment]:
    indexes = MapIndexes(world.maps)

    def work(job: Job, tell: OnTold) -> Segment:
        return _write(world, job, indexes, lambda recording, frames: tell((recording, frames)))

    return work
