"""Sources whose recordings lie in files of their own: opened cheaply, read in turn, a bad one left out."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from scenicq.errors import DataError, Diagnostic
from scenicq.geometry.features import MapFeature, ProblemSink
from scenicq.importers.base import ClassNames, LabelChecker, OpenedSource, RecordingEntry
from scenicq.importers.folders import readable
from scenicq.importers.recording_checks import check_order
from scenicq.importers.report import Report
from scenicq.store.columns import RecordingColumns
from scenicq.store.labels import Label

__all__ = ["FileReader", "RecordingFiles", "by_file_source", "content_digest", "map_sink", "missing", "take_map"]

Make = Callable[["RecordingFiles", ClassNames, Report], list[tuple[Label, str]]]


@dataclass(frozen=True, slots=True)
class RecordingFiles:
    """Where a recording lies.

    Attributes:
        name: Name of the recording, unique in the source.
        files: What it is read from; the first is the main one.
        root: The source as the user gave it; paths of sensor files are relative to it.
        map: Name of its map.
        options: What else the importer's function needs to know.
        weight: About how many label objects it has; by default from the size of the main file.
        digest: Checksum of its content; by default of the files.
    """

    name: str
    files: tuple[Path, ...]
    root: Path
    map: str
    options: tuple[str, ...] = ()
    weight: int | None = None
    digest: str = ""


@dataclass(frozen=True, slots=True)
class FileReader:
    """Reads some recordings.

    Attributes:
        places: In order of their names.
        classes: Class of the tree for each class name.
        make: Function of a module that reads a recording: labels with their places for messages.
    """

    places: tuple[RecordingFiles, ...]
    classes: Mapping[str, str]
    make: Make

    def recordings(self, labels: LabelChecker, report: Report) -> Iterator[RecordingColumns]:
        """The recordings in order of their names."""
        classes = ClassNames(self.classes, report)
        for place in self.places:
            try:
                made = self.make(place, classes, report)
            except DataError as error:
                for diagnostic in error.diagnostics:
                    report.leave_out("recording", diagnostic.code, diagnostic.message, hints=diagnostic.hints)
                continue
            check_order(place.name, [label.timestamp_us for label, _ in made], report, numbered=True)
            if (recording := labels.check_labels(place.name, made)) is not None:
                yield recording


def by_file_source(
    name: str,
    maps: Mapping[str, tuple[MapFeature, ...]],
    places: Sequence[RecordingFiles],
    classes: Mapping[str, str],
    make: Make,
    *,
    frames: int,
    object_bytes: int,
    facts: Mapping[str, Any],
) -> OpenedSource:
    """A source of such recordings.

    Args:
        name: Name of the source.
        maps: Elements of each map.
        places: The recordings.
        classes: Class of the tree for each class name.
        make: See `FileReader`.
        frames: Number of labels, for progress only.
        object_bytes: About what a label object takes in the main file.
        facts: See `OpenedSource`.
    """
    named = (replace(place, name=readable(place.name), map=readable(place.map)) for place in places)
    ordered = sorted(named, key=lambda place: place.name)
    by_name = {place.name: place for place in ordered}
    return OpenedSource(
        name=readable(name),
        maps=maps,
        entries=tuple(
            RecordingEntry(
                place.name,
                _size(place.files[0]) // object_bytes if place.weight is None else place.weight,
                place.digest or content_digest(place.files, place.options),
            )
            for place in by_name.values()
        ),
        reader=lambda names: FileReader(tuple(by_name[name] for name in names), classes, make),
        frames=frames,
        context=json.dumps(sorted(classes.items())),
        facts=facts,
    )


def content_digest(files: Iterable[Path], more: Iterable[str] = ()) -> str:
    """A digest of the contents of files; one that cannot be read counts as empty."""
    digest = hashlib.blake2b(repr(tuple(more)).encode(errors="backslashreplace"), digest_size=16)
    for path in files:
        try:
            with path.open("rb") as file:
                digest.update(hashlib.file_digest(file, "blake2b").digest())
        except OSError:
            digest.update(b"unreadable")
    return digest.hexdigest()


def _size(file: Path) -> int:
    try:
        return file.stat().st_size
    except OSError:
        return 0


def map_sink(file: str, report: Report) -> ProblemSink:
    """Takes problems of a map; what dangles is kept, with a defect, as maps end somewhere."""

    def tell(element: str, problem: str) -> None:
        add = report.keep if "is not in the map" in problem else report.leave_out
        add("map element", "map-invalid", f"{file}: element `{element}`: {problem}")

    return tell


def take_map(
    name: str,
    file: Path,
    read: Callable[[Path, ProblemSink, Report], tuple[MapFeature, ...]],
    maps: dict[str, tuple[MapFeature, ...]],
    report: Report,
) -> None:
    """Read a map, unless there is one of that name; one that cannot be read at all is left out.

    Args:
        name: Name of the map.
        file: Where it lies.
        read: Reads it; what is unsound goes to the sink, counts of what is not read to the report.
        maps: Takes it.
        report: Takes what is unsound.
    """
    if (name := readable(name)) in maps:
        return
    try:
        maps[name] = read(file, map_sink(file.name, report), report)
    except DataError as error:
        for diagnostic in error.diagnostics:
            report.leave_out("map", diagnostic.code, diagnostic.message)


def missing(path: Path, what: str) -> DataError:
    """A source that lacks what it must have."""
    return DataError(Diagnostic("file-missing", f"{path} has {what}"))
