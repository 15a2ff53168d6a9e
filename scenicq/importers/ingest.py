"""From a source to a dataset: choose the importer, read, write."""

from __future__ import annotations

import platform
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.base import Importer, Options, Source, read_class_map
from scenicq.importers.registry import choose_importer
from scenicq.importers.report import Report
from scenicq.store.labels import Recording
from scenicq.store.manifest import LeftOut, Manifest
from scenicq.store.schema import ArrowTable
from scenicq.store.writer import DatasetWriter, check_target

__all__ = ["IngestSummary", "Progress", "ingest"]


@dataclass(frozen=True, slots=True)
class Progress:
    """How far an ingest is: frames written, frames that the source claims, and the recording written last."""

    frames: int
    total: int
    recording: str


@dataclass(frozen=True, slots=True)
class IngestSummary:
    """What an ingest did.

    Attributes:
        target: The dataset's folder.
        importer: Name of the importer.
        frames, objects, tracks, recordings: How many the dataset has.
        by_class: Label objects of each class of the tree.
        left_out: What was left out or kept with a defect, with counts.
        diagnostics: Warnings that say which, at most a few of each kind.
    """

    target: Path
    importer: str
    frames: int
    objects: int
    tracks: int
    recordings: int
    by_class: Mapping[str, int]
    left_out: tuple[LeftOut, ...]
    diagnostics: tuple[Diagnostic, ...]


def ingest(
    source: str | Path,
    target: str | Path,
    *,
    format: str | None = None,
    maps: Sequence[str | Path] = (),
    class_map: str | Path | None = None,
    strict: bool = False,
    force: bool = False,
    jobs: int = 1,
    progress: Callable[[Progress], None] | None = None,
) -> IngestSummary:
    """Make a dataset from a source.

    The target is the whole dataset or, after an error, an interrupt or SIGTERM, what it was before.

    Args:
        source: A folder that an importer recognises.
        target: Folder of the dataset to be.
        format: Name of the importer; found out by default.
        maps: GeoJSON maps, `FILE` (the map is called like the file) or `NAME=FILE`; they replace maps of the source.
        class_map: JSON file {class of the source: class of the tree}, before the source's own classes.
        strict: Whether the first problem of the source is an error.
        force: Whether a dataset that is there already may be replaced.
        jobs: Number of threads that compute what depends on the map; the result does not depend on it.
        progress: Called after each recording; what it raises ends the ingest.

    Raises:
        DataError: The source, an option or the target cannot be used; with `strict` any problem of the source.
    """
    source_path, target_path = Path(source), Path(target)
    importer = choose_importer(source_path, format)
    options = Options(_map_files(maps), {} if class_map is None else read_class_map(Path(class_map)))
    report = Report(strict=strict)
    check_target(target_path, force=force)  # reading a large source only to find the target taken would be unkind
    with _terminable():
        opened = importer.read(source_path, options, report)
        with closing(opened.recordings), DatasetWriter(target_path, opened.maps, force=force) as writer:
            frames = 0
            for recording, rows in _prepared(opened.recordings, writer, jobs):
                writer.add(recording, rows)
                frames += len(recording.labels)
                if progress is not None:
                    progress(Progress(frames, opened.frames, recording.name))
            if frames == 0:
                raise DataError([Diagnostic("dataset-empty", f"{source_path} holds no frame"), *report.diagnostics])
            provenance = _provenance(source_path, opened, options, class_map, strict)
            manifest = writer.finish(
                name=opened.name, importer=importer.name, left_out=report.counts, provenance=provenance
            )
    return _summary(target_path, importer, manifest, report)


def _summary(target: Path, importer: Importer, manifest: Manifest, report: Report) -> IngestSummary:
    return IngestSummary(
        target=target,
        importer=importer.name,
        frames=manifest.total.frames,
        objects=manifest.total.objects,
        tracks=manifest.tracks,
        recordings=len(manifest.by_recording),
        by_class=manifest.by_class,
        left_out=manifest.left_out,
        diagnostics=report.diagnostics,
    )


def _prepared(
    recordings: Iterator[Recording], writer: DatasetWriter, jobs: int
) -> Iterator[tuple[Recording, Mapping[str, ArrowTable]]]:
    """Recordings in their order with their rows; at most a few recordings are held."""
    if jobs <= 1:
        for recording in recordings:
            yield recording, writer.prepare(recording)
        return
    with ThreadPoolExecutor(jobs) as threads:
        waiting: deque[tuple[Recording, Future[dict[str, ArrowTable]]]] = deque()
        try:
            for recording in recordings:
                writer.index(recording.map)  # built here, so that no two threads build it
                waiting.append((recording, threads.submit(writer.prepare, recording)))
                if len(waiting) > jobs:
                    first, rows = waiting.popleft()
                    yield first, rows.result()
            while waiting:
                first, rows = waiting.popleft()
                yield first, rows.result()
        finally:
            for _, rows in waiting:
                rows.cancel()


@contextmanager
def _terminable() -> Generator[None]:
    """Let SIGTERM end the block like Ctrl-C, so that what is half written goes away."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _map_files(maps: Sequence[str | Path]) -> dict[str, Path]:
    files: dict[str, Path] = {}
    for given in maps:
        name, equals, file = str(given).partition("=")
        path = Path(file if equals else name)
        if not path.is_file():
            raise DataError(Diagnostic("file-missing", f"map {path} is not there"))
        files[name if equals else path.stem] = path
    return files


def _provenance(
    source: Path, opened: Source, options: Options, class_map: str | Path | None, strict: bool
) -> dict[str, object]:
    return {
        # A file's name need not be text.
        "source": str(source).encode(errors="backslashreplace").decode(),
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": {"python": platform.python_version()}
        | {package: _version(package) for package in ("scenicq", "numpy", "pyarrow", "shapely")},
        "options": {
            "maps": {name: str(file) for name, file in options.maps.items()},
            "class_map": None if class_map is None else str(class_map),
            "strict": strict,
        },
        "facts": dict(opened.facts),
    }


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
