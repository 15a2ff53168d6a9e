"""The interface of importers, and what all of them share: options, class names, maps, checks of labels.

An importer knows one dataset format. It makes columns of labels, or plain labels that become columns, in the
conventions of `scenicq.store.labels`. Everything else is the store's: columns computed from the map, files, checksums.
Read next: `interchange.py`, an example.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic, similar
from scenicq.importers.fields import NO_MAP, InvalidError, parse_json
from scenicq.importers.folders import read_bytes
from scenicq.importers.report import Report
from scenicq.store.classes import ROOT, is_class, subclasses
from scenicq.store.columns import RecordingColumns, columns_of, take_labels
from scenicq.store.labels import Label, Recording
from scenicq.store.value_rules import Problems, find_problems

if TYPE_CHECKING:
    from scenicq.geometry.features import MapFeature

__all__ = [
    "ClassNames",
    "ImportOptions",
    "Importer",
    "LabelChecker",
    "OpenedSource",
    "RecordingEntry",
    "RecordingReader",
    "read_class_map",
    "read_maps",
]


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """What the user may tell every importer.

    Attributes:
        maps: GeoJSON files by the names of maps. They add to the source's maps; of one name, this file counts.
        class_map: Classes of the tree by class names of the source; these count before the source's own taxonomy.
        ego: Which track becomes the ego of a source that has none, "nearest" (in each frame, the vehicle nearest to the
            middle of all objects) or "none". None stands for "nearest" and is reported.
        scratch: Folder for temporary files that must outlive `Importer.read`; its owner removes it.
    """

    maps: Mapping[str, Path] = field(default_factory=dict[str, Path])
    class_map: Mapping[str, str] = field(default_factory=dict[str, str])
    scratch: Path | None = None
    ego: str | None = None


@dataclass(frozen=True, slots=True)
class RecordingEntry:
    """A recording that a source lists, before it is read.

    Attributes:
        name: Name of the recording, unique in the source.
        weight: Estimate of how many label objects it has.
        digest: Checksum that changes with what the source says of the recording.
    """

    name: str
    weight: int
    digest: str


class RecordingReader(Protocol):
    """Reads some recordings of a source; pickled, because it may run in another process."""

    def recordings(self, labels: LabelChecker, report: Report) -> Iterator[RecordingColumns]:
        """The recordings in order of their names, each with at least one label.

        Args:
            labels: Checks labels, also against each other.
            report: Collects what is unsound.
        """
        ...


@dataclass(frozen=True, slots=True)
class OpenedSource:
    """A source whose maps and list of recordings have been read, but no recording.

    Attributes:
        name: What the source calls itself.
        maps: Map elements, by the names of maps.
        entries: The recordings in order of their names.
        reader: Makes a reader of some recordings, by their names.
        frames: Number of labels that the source claims to have, for progress alone.
        context: Checksum of all that labels depend on besides maps and recordings, such as a class map.
        facts: How values were made, for the provenance of the dataset.
    """

    name: str
    maps: Mapping[str, tuple[MapFeature, ...]]
    entries: tuple[RecordingEntry, ...]
    reader: Callable[[Sequence[str]], RecordingReader]
    frames: int
    context: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def recordings(self, report: Report) -> Iterator[RecordingColumns]:
        """Read all recordings, one after the other."""
        return self.reader([entry.name for entry in self.entries]).recordings(LabelChecker(self.maps, report), report)


class Importer(Protocol):
    """One dataset format."""

    @property
    def name(self) -> str:
        """The name for `--format`, one word in lower case."""
        ...

    @property
    def layout(self) -> str:
        """The files by which a source is recognised, for messages."""
        ...

    def recognises(self, path: Path) -> bool:
        """Whether a source is of this format; must be cheap, and False for every source of another format."""
        ...

    def read(self, path: Path, options: ImportOptions, report: Report) -> OpenedSource:
        """Open a source.

        What is unsound is left out and reported; a source that cannot be read at all is an error.

        Raises:
            DataError: `file-missing` or `file-invalid`; with a strict report, the code of whatever is unsound.
        """
        ...


class ClassNames:
    """Translates class names of a source into the class tree.

    Attributes:
        known: Classes of the tree by the source's names.
    """

    def __init__(self, known: Mapping[str, str], report: Report) -> None:
        """Take the source's taxonomy, in which the user's class map has replaced what it names."""
        self.known = known
        self._report = report

    def category(self, name: str) -> str:
        """The class of the tree; for an unknown name it is `Object`, which is reported."""
        if (category := self.known.get(name)) is not None:
            return category
        message = f"class `{name}` has no class of the tree; its objects become `{ROOT}`"
        near = similar(name.capitalize(), subclasses(ROOT))
        suggestion = f'"{near}"' if near else "CLASS"
        hint = f'a class map with {{"{name}": {suggestion}}} gives it a class: `--class-map FILE`'
        self._report.keep("object", "unknown-class", message, name=name, hints=(hint,))
        return ROOT


class LabelChecker:
    """Keeps the sound labels of a source.

    A label is sound if its values are possible, no earlier label of the source has its id, and none of its recording
    has its time. What is not sound is left out and reported: whole labels, or objects and sensor files of a label.
    """

    def __init__(self, maps: Collection[str], report: Report, taken: Collection[tuple[str, str]] = frozenset()) -> None:
        """Start without labels.

        Args:
            maps: Names of the maps that there are.
            report: Collects what is left out.
            taken: Recordings and ids of labels whose id an earlier recording has, where those of all are known before.
        """
        self._maps = maps
        self._report = report
        self._taken = taken
        self._frames: set[str] = set()

    def check_labels(self, name: str, labels: Sequence[tuple[Label, str]]) -> RecordingColumns | None:
        """Keep the sound labels of a recording; as `check_columns`, for plain labels.

        Args:
            name: The name of the recording.
            labels: Labels in any order, each with its file and line in the source, for messages.
        """
        plain = [label for label, _ in labels]
        columns = columns_of(Recording(name, plain[0].map if plain else "", tuple(plain)))
        return self.check_columns(columns, [source_line for _, source_line in labels], [label.map for label in plain])

    def check_columns(
        self, columns: RecordingColumns, source_lines: Sequence[object], maps: Sequence[str] | None = None
    ) -> RecordingColumns | None:
        """Keep the sound labels of a recording, sorted by time; None if there is none.

        Args:
            columns: The labels in any order.
            source_lines: File and line of each label in the source, for messages; `str` is called for reported ones.
            maps: The map of each label, if they may differ.
        """
        problems = find_problems(columns)
        order: list[int] = []
        times: dict[int, str] = {}
        for number, (frame, time) in enumerate(zip(columns.frames, columns.times_us, strict=True)):
            if frame in self._frames or (columns.name, frame) in self._taken:
                self._leave_out(f"{source_lines[number]}: label id `{frame}` is used twice")
            elif maps is not None and maps[number] != columns.map:
                message = f"label `{frame}` has map `{maps[number]}`, its recording began with `{columns.map}`"
                self._leave_out(f"{source_lines[number]}: {message}")
            elif time in times:
                message = f"label `{frame}` has the time of label `{times[time]}`"
                self._leave_out(f"{source_lines[number]}: {message} in recording `{columns.name}`")
            elif number in problems.labels:
                self._leave_out(f"{source_lines[number]}: label `{frame}` or its ego: {problems.labels[number]}")
            else:
                self._frames.add(frame)
                times[time] = frame
                order.append(number)
        if not order:
            self._report.leave_out("recording", "record-invalid", f"recording `{columns.name}` has no sound label")
            return None
        if columns.map not in self._maps:
            self._report_missing_map(columns.map, len(order))
        objects, sensors = self._sound_rows(columns, problems, source_lines, order)
        order.sort(key=lambda number: (columns.times_us[number], columns.frames[number]))
        unchanged = order == list(range(len(columns.frames)))
        if unchanged and objects.all() and sensors.all():
            return columns
        return take_labels(columns, order, objects, sensors)

    def _report_missing_map(self, map_name: str, label_count: int) -> None:
        if map_name == NO_MAP:
            message = "labels have no map: no road, lane or direction of traffic is known for them"
            self._report.assume("map", "no map", message, hints=("`--map none=FILE.geojson` gives one",))
            return
        message = f"map `{map_name}` is not there; its labels are kept without a road network"
        hint = f"`--map {map_name}=FILE.geojson` gives the map"
        for _ in range(label_count):
            self._report.keep("label", "map-missing", message, name=map_name, hints=(hint,))

    def _leave_out(self, message: str) -> None:
        self._report.leave_out("label", "record-invalid", message)

    def _sound_rows(
        self, columns: RecordingColumns, problems: Problems, source_lines: Sequence[object], labels: Sequence[int]
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which rows of objects and of sensor files are sound, for some labels; what is not is reported."""
        ids, tracks = columns.objects.id, columns.objects.track
        objects = np.ones(len(ids), dtype=bool)
        sensors = np.ones(len(columns.paths), dtype=bool)
        object_ends: list[int] = np.cumsum(columns.object_counts).tolist()
        sensor_ends: list[int] = np.cumsum(columns.sensor_counts).tolist()
        for label in labels:
            first, end = object_ends[label] - int(columns.object_counts[label]), object_ends[label]
            owner, ego = f"of label `{columns.frames[label]}`", columns.egos.track[label]
            names, known = set(ids[first:end]), [track for track in tracks[first:end] if track is not None]
            # nearly all labels pass this test, which is cheaper than to go through their objects
            ambiguous = len(names) < end - first or "ego" in names or len(set(known)) < len(known) or ego in known
            if ambiguous or not problems.objects.keys().isdisjoint(range(first, end)):
                for row, fact in _find_unsound(ids, tracks, range(first, end), owner, ego, problems.objects):
                    objects[row] = False
                    self._report.leave_out("object", "record-invalid", f"{source_lines[label]}: {fact}")
            for row in range(sensor_ends[label] - int(columns.sensor_counts[label]), sensor_ends[label]):
                if (problem := problems.sensors.get(row)) is not None:
                    sensors[row] = False
                    message = f"{source_lines[label]}: sensor file `{columns.channels[row]}` {owner}: {problem}"
                    self._report.leave_out("sensor file", "record-invalid", message)
        return objects, sensors


def _find_unsound(
    ids: Sequence[str], tracks: Sequence[str | None], rows: range, owner: str, ego: str | None,
    problems: Mapping[int, str],
) -> Iterator[tuple[int, str]]:  # fmt: skip
    """The rows of a label's objects that are left out, with the reason; of equal ids or tracks, the first stays."""
    seen = {"ego"}
    owners: dict[str, str] = {} if ego is None else {ego: "ego"}
    for row in rows:
        id, track = ids[row], tracks[row]
        if id in seen:
            yield row, f"object id `{id}` {owner} {'is kept for the ego' if id == 'ego' else 'is used twice'}"
        elif row in problems:
            yield row, f"object `{id}` {owner}: {problems[row]}"
        elif track is not None and track in owners:
            yield row, f"object `{id}` {owner}: has the track `{track}` of object `{owners[track]}`, which is kept"
        else:
            seen.add(id)
            owners |= {} if track is None else {track: id}


def read_maps(files: Mapping[str, Path], report: Report) -> dict[str, tuple[MapFeature, ...]]:
    """Read GeoJSON maps.

    Args:
        files: Files by the names of maps.
        report: Collects what is unsound.

    Raises:
        DataError: `file-missing` or `file-invalid`.
    """
    if not files:
        return {}
    from scenicq.importers.map_files import read_geojson_maps  # noqa: PLC0415 - slow to load, and for maps

    return read_geojson_maps(files, report)


def read_class_map(path: Path) -> dict[str, str]:
    """Read a class map, `{class name of the source: class of the tree}`.

    Raises:
        DataError: `file-missing`, `file-invalid`, or `unknown-class` for a class that the tree lacks.
    """
    try:
        content = parse_json(read_bytes(path))
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"class map {path} cannot be read: {error.strerror}")) from error
    except InvalidError as error:
        raise DataError(Diagnostic("file-invalid", f"class map {path}: {error}")) from error
    pairs = cast(dict[str, object], content) if isinstance(content, dict) else {}
    if not pairs or not all(isinstance(category, str) for category in pairs.values()):
        message = f"class map {path} is not a JSON object of texts"
        raise DataError(Diagnostic("file-invalid", message, hints=('write {"name in the source": "Car"}',)))
    classes = {name: str(category) for name, category in pairs.items()}
    unknown = sorted({category for category in classes.values() if not is_class(category)})
    if unknown:
        listed = ", ".join(f"`{category}`" for category in unknown)
        raise DataError(Diagnostic("unknown-class", f"class map {path} uses classes that the tree lacks: {listed}"))
    return classes
