"""From a source to a dataset: choose the importer, read, write."""

from __future__ import annotations

import platform
import shutil
import signal
import threading
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from scenicq import __version__
from scenicq.errors import DataError, Diagnostic
from scenicq.importers.base import Importer, ImportOptions, OpenedSource, RecordingEntry, read_class_map
from scenicq.importers.ego_choice import WITHOUT_EGO
from scenicq.importers.fields import LONGEST_TEXT
from scenicq.importers.folders import readable
from scenicq.importers.opendrive import convert_maps
from scenicq.importers.registry import choose_importer
from scenicq.importers.report import Report
from scenicq.importers.segments import (
    Job,
    RecordingTask,
    SegmentPlace,
    World,
    fingerprint,
    is_on_maps,
    map_digests,
    write_segments,
)
from scenicq.store.manifest import Manifest, Omission, Provenance, is_dataset
from scenicq.store.segment import SEGMENT_OBJECTS, is_whole, read_segments, segments_of
from scenicq.store.writer import DatasetWriter

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
        reused: Recordings that were taken over from the dataset or from an ingest that was killed.
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
    reused: int
    by_class: Mapping[str, int]
    left_out: tuple[Omission, ...]
    diagnostics: tuple[Diagnostic, ...]


def ingest(
    source: str | Path,
    target: str | Path,
    *,
    format: str | None = None,
    maps: Sequence[str | Path] = (),
    class_map: str | Path | None = None,
    ego: str | None = None,
    map_cache: str | Path | None = None,
    strict: bool = False,
    force: bool = False,
    update: bool = False,
    jobs: int | None = 1,
    progress: Callable[[Progress], None] | None = None,
    segment_objects: int = SEGMENT_OBJECTS,
) -> IngestSummary:
    """Make a dataset from a source.

    The target is the whole dataset or, after an error, an interrupt or SIGTERM, what it was before. A process that is
    killed leaves a hidden folder beside the target; the next ingest takes over what is complete and still true in it.

    Args:
        source: A folder that an importer recognises.
        target: Folder of the dataset to be.
        format: Name of the importer; found out by default.
        maps: GeoJSON or OpenDRIVE maps, `FILE` (the map is called like the file) or `NAME=FILE`; they replace maps of
            the source.
        class_map: JSON file {class of the source: class of the tree}, before the source's own classes.
        ego: For sources without an ego: a track, "nearest" or "none"; see `ImportOptions.ego`.
        map_cache: Folder that keeps what Scenic's parser makes of OpenDRIVE maps; a temporary one by default.
        strict: Whether the first problem of the source is an error.
        force: Whether a dataset that is there already may be replaced, and everything is to be done anew.
        update: Whether a dataset that is there already is brought up to date: recordings that are new or have changed
            are read, those that the source no longer has go. The result is that of an ingest of the whole source,
            but that messages about what is not read again name lines as they were.
        jobs: Number of processes, None for as many as pays; the result does not depend on it.
        progress: Called after each recording; what it raises ends the ingest.
        segment_objects: About how many label objects a part of the tables has at most.

    Raises:
        DataError: The source, an option or the target cannot be used; with `strict` any problem of the source.
    """
    source_path, target_path = Path(source), Path(target)
    importer = choose_importer(source_path, format)
    if ego is not None and importer.name not in WITHOUT_EGO:
        message = f"`--ego` is for sources without an ego; {importer.name} says of each frame which it is"
        hint = "leave it out; `--ego any` at matching lets every object of a class be the scenario's ego"
        raise DataError(Diagnostic("option-invalid", message, hints=(hint,)))
    given = _map_files(maps)
    classes = {} if class_map is None else read_class_map(Path(class_map))
    report = Report(strict=strict)
    with _terminable(), DatasetWriter(target_path, {}, force=force, update=update) as writer:
        scratch = _scratch(writer)
        converted = convert_maps(given, scratch if map_cache is None else Path(map_cache), report)
        options = ImportOptions(converted, classes, scratch, ego)
        opened = importer.read(source_path, options, report)
        if opened.maps:
            from scenicq.importers.map_files import on_the_map  # noqa: PLC0415 - slow to load, and for maps

            opened = replace(opened, maps=on_the_map(opened.maps, report))
        writer.maps = opened.maps
        entries = {entry.name: entry for entry in opened.entries}
        groups = [
            [entries[name] for name in names]
            for names in segments_of([(entry.name, entry.weight) for entry in opened.entries], segment_objects)
        ]
        reached = _Reached(opened.frames, progress)
        known = _known(writer, target_path if update and not force else None)
        # some importers take the first map that is given
        context = (opened.context, repr(list(converted)), str(strict))
        reused = _write_all(opened, writer, groups, known, context, strict=strict, jobs=jobs, reached=reached)
        for segment in writer.segments:
            for piece in segment.pieces.values():
                report.merge(piece.counts, piece.told)
        if not any(segment.recordings for segment in writer.segments):
            raise DataError([Diagnostic("dataset-empty", f"{source_path} holds no frame"), *report.diagnostics])
        provenance = _provenance(source_path, opened, replace(options, maps=given), class_map, strict)
        manifest = writer.finish(
            name=opened.name, importer=importer.name, left_out=report.counts, provenance=provenance
        )
    return _summary(target_path, importer, manifest, (*_misfits(target_path, manifest), *report.diagnostics), reused)


def _misfits(target: Path, manifest: Manifest) -> tuple[Diagnostic, ...]:
    """What does not fit between maps and labels."""
    if not any(manifest.maps.values()):
        return ()
    from scenicq.store.dataset import open_dataset  # noqa: PLC0415 - slow to load, and for maps
    from scenicq.store.map_fit import map_fits, misfits  # noqa: PLC0415 - slow to load, and for maps

    dataset = open_dataset(target, check=False)
    try:
        return misfits(map_fits(dataset))
    finally:
        dataset.release()


class _Reached:
    """Counts what is done, and says so."""

    def __init__(self, total: int, progress: Callable[[Progress], None] | None) -> None:
        self._total = total
        self._progress = progress
        self._frames = 0

    def __call__(self, recording: str, frames: int) -> None:
        self._frames += frames
        if self._progress is not None:
            self._progress(Progress(self._frames, self._total, recording))


def _scratch(writer: DatasetWriter) -> Path:
    folder = writer.folder / "scratch"
    try:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
    except OSError as error:
        raise writer.unwritable(error) from error
    return folder


@dataclass(frozen=True, slots=True)
class _EarlierWork:
    """What need not be made again.

    Attributes:
        segments: Segments by their fingerprint, and the number that the segment must have; None for any.
        pieces: Recordings by their fingerprint.
    """

    segments: Mapping[tuple[str, int | None], SegmentPlace]
    pieces: Mapping[str, SegmentPlace]


def _known(writer: DatasetWriter, target: Path | None) -> _EarlierWork:
    """What a killed ingest left, at its places, and what the dataset has that is brought up to date."""
    old = {} if target is None or not is_dataset(target) else read_segments(target)
    segments: dict[tuple[str, int | None], SegmentPlace] = {}
    for number, segment in old.items():
        segments[segment.fingerprint, None] = SegmentPlace(target or writer.folder, number, segment)
    for number, segment in writer.left.items():
        segments[segment.fingerprint, number] = SegmentPlace(writer.folder, number, segment)
    pieces = {
        piece.fingerprint: place
        for place in segments.values()
        for name, piece in place.segment.pieces.items()
        if piece.fingerprint and (name in place.segment.rows) == (name in place.segment.recordings)
    }
    return _EarlierWork(segments, pieces)


def _write_all(
    opened: OpenedSource,
    writer: DatasetWriter,
    groups: Sequence[Sequence[RecordingEntry]],
    known: _EarlierWork,
    context: Sequence[str],
    *,
    strict: bool,
    jobs: int | None,
    reached: _Reached,
) -> int:
    """Write or take over every segment; the result is the number of recordings that were taken over."""
    digests = map_digests(opened.maps)
    world = World(writer.folder, opened.maps, digests, strict)
    whole: dict[tuple[Path, int], bool] = {}
    reused: dict[int, int] = {}
    todo = {number: frozenset[tuple[str, str]]() for number in range(len(groups))}
    everything = dict(todo)
    while todo:
        waiting: list[Job] = []
        moves: list[tuple[int, SegmentPlace]] = []
        for number, taken in todo.items():
            reused[number] = 0
            mark = fingerprint(context, groups[number], taken)
            found = known.segments.get((mark, number)) or known.segments.get((mark, None))
            if found is not None and is_on_maps(found.segment.pieces.values(), digests):
                moves.append((number, found))
                continue
            shares: list[RecordingTask] = []
            for entry in groups[number]:
                own = fingerprint(context, [entry], frozenset(each for each in taken if each[0] == entry.name))
                old = known.pieces.get(own)
                if old is not None and not is_on_maps([old.segment.pieces[entry.name]], digests):
                    old = None
                if old is not None:
                    if (old.folder, old.number) not in whole:
                        whole[old.folder, old.number] = is_whole(old.segment, old.folder, old.number)
                    old = old if whole[old.folder, old.number] else None
                reused[number] += old is not None and entry.name in old.segment.recordings
                shares.append(RecordingTask(entry.name, own, opened.reader([entry.name]), old))
            waiting.append(Job(number, tuple(shares), mark, taken))
        for number, old in moves:
            reused[number] = _take_over(writer, number, old, reached)
        try:
            written = write_segments(world, waiting, jobs, reached)
            for job, segment in zip(waiting, written, strict=True):
                writer.adopt(job.number, segment)
        except OSError as error:
            raise writer.unwritable(error) from error
        todo = {}
        for number, recording, frame in writer.repeated_frames():
            todo[number] = everything[number] = everything[number] | {(recording, frame)}
    return sum(reused.values())


def _take_over(writer: DatasetWriter, number: int, old: SegmentPlace, reached: _Reached) -> int:
    """Take over a whole segment; the result is the number of its recordings."""
    at_place = (old.folder, old.number) == (writer.folder, number)
    writer.adopt(number, old.segment, None if at_place else (old.folder, old.number))
    for name, counts in old.segment.recordings.items():
        reached(name, counts.frames)
    return len(old.segment.recordings)


def _summary(
    target: Path, importer: Importer, manifest: Manifest, diagnostics: tuple[Diagnostic, ...], reused: int
) -> IngestSummary:
    return IngestSummary(
        target=target,
        importer=importer.name,
        frames=manifest.total.frames,
        objects=manifest.total.objects,
        tracks=manifest.tracks,
        recordings=len(manifest.by_recording),
        reused=reused,
        by_class=manifest.by_class,
        left_out=manifest.left_out,
        diagnostics=diagnostics,
    )


@contextmanager
def _terminable() -> Generator[None]:
    """Let SIGTERM and SIGHUP end the block like Ctrl-C, so that what is half written goes away.

    What the caller handles or ignores stays with the caller.
    """
    taken: list[int] = []
    if threading.current_thread() is threading.main_thread():
        fatal = [signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]
        taken += [each for each in fatal if signal.getsignal(each) is signal.SIG_DFL]
    for each in taken:
        signal.signal(each, signal.default_int_handler)
    try:
        yield
    finally:
        for each in taken:
            signal.signal(each, signal.SIG_DFL)


def _map_files(maps: Sequence[str | Path]) -> dict[str, Path]:
    files: dict[str, Path] = {}
    for given in maps:
        name, equals, file = str(given).partition("=")
        path = Path(file if equals else name)
        if not path.is_file():
            raise DataError(Diagnostic("file-missing", f"map {path} is not there"))
        if not 0 < len(name if equals else path.stem) <= LONGEST_TEXT:
            message = f"the name of map {path} is empty, or has more than {LONGEST_TEXT} characters"
            raise DataError(Diagnostic("option-invalid", message))
        files[readable(name if equals else path.stem)] = path
    return files


def _provenance(
    source: Path, opened: OpenedSource, options: ImportOptions, class_map: str | Path | None, strict: bool
) -> Provenance:
    return Provenance(
        source=readable(source),
        time=datetime.now(UTC).isoformat(timespec="seconds"),
        versions={"python": platform.python_version(), "scenicq": __version__}
        | {package: _version(package) for package in ("numpy", "pyarrow", "shapely")},
        options={
            "maps": {readable(name): readable(file) for name, file in options.maps.items()},
            "class_map": None if class_map is None else readable(class_map),
            "ego": None if options.ego is None else readable(options.ego),
            "strict": strict,
        },
        facts=dict(opened.facts),
    )


def _version(package: str) -> str | None:
    from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415 - slow to load

    try:
        return version(package)
    except PackageNotFoundError:
        return None
