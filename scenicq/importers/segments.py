"""One segment of an ingest as a value, and the process that writes it.

What a segment holds depends on its job alone, so segments can be written here or there, now or in an earlier ingest.
"""

from __future__ import annotations

import gc
import hashlib
import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from multiprocessing.queues import SimpleQueue
from multiprocessing.synchronize import Event
from pathlib import Path

import shapely

from scenicq.errors import DataError, Diagnostic
from scenicq.geometry.features import MapFeature
from scenicq.importers.base import Entry, Labels, Reader
from scenicq.importers.report import Report
from scenicq.store.columns import columns_of
from scenicq.store.labels import Recording
from scenicq.store.placement import MapIndex
from scenicq.store.schema import SCHEMA_VERSION
from scenicq.store.segment import Segment, SegmentWriter

__all__ = ["Job", "World", "fingerprint", "maps_digest", "write_segments"]

OnRecording = Callable[[str, int], None]
"""Called with a recording and its number of frames when it is written."""


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
        taken: Recording and frame of labels that are left out, because earlier recordings use the same name.
    """

    number: int
    reader: Reader = field(repr=False)
    fingerprint: str
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
    for name in sorted(maps):
        digest.update(json.dumps(name).encode())
        for feature in maps[name]:
            digest.update(json.dumps([feature.id, feature.kind, dict(feature.properties)]).encode())
            digest.update(shapely.to_wkb(feature.shape))
    return digest.hexdigest()


def write_segments(world: World, jobs: Sequence[Job], processes: int, on_recording: OnRecording) -> Iterator[Segment]:
    """Write segments, here or in other processes; the files do not depend on where.

    Args:
        world: What the jobs share.
        jobs: In order.
        processes: How many work side by side; with one it is this one.
        on_recording: Called in this process; what it raises ends the work.

    Yields:
        The segments in order of the jobs.

    Raises:
        DataError: A problem of the source where the ingest is strict, or a process died.
        OSError: The folder cannot be written.
    """
    if processes <= 1 or len(jobs) <= 1:
        indexes: dict[str, MapIndex] = {}
        for job in jobs:
            yield _write(world, job, indexes, on_recording)
        return
    with _pool(world, min(processes, len(jobs))) as (pool, told):
        futures = [pool.submit(_work, job) for job in jobs]
        try:
            for future in futures:
                while not _is_done(future):
                    _tell(told, on_recording)
                _tell(told, on_recording)
                yield future.result()
        except BrokenProcessPool as error:
            message = "a process of the ingest was killed, perhaps for want of memory"
            raise DataError(Diagnostic("budget-exceeded", message, hints=("use fewer `--jobs`",))) from error


def _write(world: World, job: Job, indexes: dict[str, MapIndex], on_recording: OnRecording) -> Segment:
    report = Report(strict=world.strict)
    writer = SegmentWriter(world.folder, job.number)
    # Records hold no cycles, and the collector would walk through all of them again and again.
    collects = gc.isenabled()
    gc.disable()
    try:
        writer.open()
        for found in job.reader.recordings(Labels(world.maps.keys(), report, job.taken), report):
            columns = columns_of(found) if isinstance(found, Recording) else found
            if columns.map not in indexes:
                indexes[columns.map] = MapIndex(columns.map, world.maps.get(columns.map, ()))
            writer.add(columns, indexes[columns.map])
            on_recording(columns.name, len(columns.frames))
        return writer.finish(job.fingerprint, report.tally, report.told)
    finally:
        if collects:
            gc.enable()
        writer.abandon()


def _is_done(future: Future[Segment]) -> bool:
    try:
        future.exception(timeout=0.05)
    except TimeoutError:
        return False
    return True


def _tell(told: SimpleQueue[tuple[str, int]], on_recording: OnRecording) -> None:
    while not told.empty():
        on_recording(*told.get())


@contextmanager
def _pool(world: World, processes: int) -> Generator[tuple[ProcessPoolExecutor, SimpleQueue[tuple[str, int]]]]:
    context = multiprocessing.get_context("spawn")
    told: SimpleQueue[tuple[str, int]] = context.SimpleQueue()
    stop = context.Event()
    pool = ProcessPoolExecutor(processes, context, initializer=_start, initargs=(world, told, stop))
    try:
        yield pool, told
    except BaseException:
        stop.set()
        # A worker may wait for room to tell: nobody listens any more.
        threading.Thread(target=_drain, args=(told,), daemon=True).start()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _drain(told: SimpleQueue[tuple[str, int]]) -> None:
    while True:
        told.get()


@dataclass(slots=True)
class _Worker:
    world: World
    told: SimpleQueue[tuple[str, int]]
    stop: Event
    indexes: dict[str, MapIndex] = field(default_factory=dict[str, MapIndex])


_worker: list[_Worker] = []


class _StoppedError(Exception):
    """The ingest has ended meanwhile."""


def _start(world: World, told: SimpleQueue[tuple[str, int]], stop: Event) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the terminal interrupts everybody; the parent says what to do
    parent = multiprocessing.parent_process()
    assert parent is not None
    # A parent that is killed says nothing, and its folder may belong to somebody else then.
    threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()
    _worker[:] = [_Worker(world, told, stop)]


def _end_with(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


def _work(job: Job) -> Segment:
    (worker,) = _worker

    def tell(recording: str, frames: int) -> None:
        if worker.stop.is_set():
            raise _StoppedError
        worker.told.put((recording, frames))

    return _write(worker.world, job, worker.indexes, tell)
