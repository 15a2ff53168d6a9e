"""One segment of an ingest as a value, and the process that writes it.

What a segment holds depends on its job alone, so segments can be written here or there, now or in an earlier ingest.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scenicq.errors import DataError, Diagnostic
from scenicq.garbage import without_collector
from scenicq.importers.base import Entry, Labels, Reader
from scenicq.importers.recording_checks import tell_recording
from scenicq.importers.report import Report
from scenicq.processes import Lost, Workers, as_many_as_pay
from scenicq.store.columns import columns_of
from scenicq.store.labels import Recording
from scenicq.store.schema import SCHEMA_VERSION
from scenicq.store.segment import MapIndexes, Segment, SegmentWriter

if TYPE_CHECKING:
    from scenicq.geometry.features import MapFeature

__all__ = ["Job", "World", "fingerprint", "maps_digest", "write_segments"]

OnRecording = Callable[[str, int], None]
"""Called with a recording and its number of frames when it is written."""
OnTold = Callable[[tuple[str, int]], None]
"""The same for a worker, which tells what is then passed on."""


@dataclass(frozen=True, slots=True)
class World:
    """What all jobs of an ingest share.

    Attributes:
        folder: Of the dataset that grows.
        maps: Elements of each map.
        strict: Whether the first problem is an error.
    """

    folder: Path
    maps: Mapping[str, Sequence[MapFeature]] = field(repr=False)
    strict: bool = False


@dataclass(frozen=True, slots=True)
class Job:
    """One segment to be written.

    Attributes:
        number: Of the segment.
        reader: Of its recordings.
        fingerprint: Of all that it depends on.
        first: Its first recording.
        taken: Recording and frame of labels that are left out, because earlier recordings use the same name.
    """

    number: int
    reader: Reader = field(repr=False)
    fingerprint: str
    first: str = ""
    taken: frozenset[tuple[str, str]] = frozenset()


def fingerprint(context: Sequence[str], entries: Sequence[Entry], taken: frozenset[tuple[str, str]]) -> str:
    """What changes with everything that a segment depends on.

    Args:
        context: What all segments of an ingest depend on.
        entries: Its recordings.
        taken: As in `Job`.
    """
    content = [SCHEMA_VERSION, *context, [[entry.name, entry.digest] for entry in entries], sorted(taken)]
    return hashlib.blake2b(json.dumps(content).encode(), digest_size=16).hexdigest()


def maps_digest(maps: Mapping[str, Sequence[MapFeature]]) -> str:
    """What changes with any element of any map."""
    digest = hashlib.blake2b(digest_size=16)
    if not maps:
        return digest.hexdigest()
    import shapely  # noqa: PLC0415 - slow to load, and for maps

    for name in sorted(maps):
        digest.update(json.dumps(name).encode())
        shapes = shapely.to_wkb(np.array([feature.shape for feature in maps[name]], dtype=object))
        for feature, shape in zip(maps[name], shapes, strict=True):
            digest.update(json.dumps([feature.id, feature.kind, dict(feature.properties)]).encode())
            digest.update(shape)
    return digest.hexdigest()


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
        many = as_many_as_pay()
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
            if isinstance(segment, Lost):
                message = (
                    f"{segment.tries} processes that wrote the recordings from `{job.first}` on were killed, "
                    "perhaps for want of memory"
                )
                raise DataError(Diagnostic("budget-exceeded", message, hints=("use fewer `--jobs`",)))
            yield segment


def _write(world: World, job: Job, indexes: MapIndexes, on_recording: OnRecording) -> Segment:
    report = Report(strict=world.strict)
    writer = SegmentWriter(world.folder, job.number)
    try:
        with without_collector():
            writer.open()
            for found in job.reader.recordings(Labels(world.maps.keys(), report, job.taken), report):
                columns = columns_of(found) if isinstance(found, Recording) else found
                tell_recording(columns, report)
                writer.add(columns, indexes.of(columns.map))
                on_recording(columns.name, len(columns.frames))
            return writer.finish(job.fingerprint, report.tally, report.told)
    finally:
        writer.abandon()


def _start_worker(world: World) -> Callable[[Job, OnTold], Segment]:
    indexes = MapIndexes(world.maps)

    def work(job: Job, tell: OnTold) -> Segment:
        return _write(world, job, indexes, lambda recording, frames: tell((recording, frames)))

    return work
