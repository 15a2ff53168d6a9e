"""What an importer is, and what all importers share: options, classes, maps, checks of labels.

An importer knows one dataset format. It yields columns, or plain labels that become columns, in the conventions of
`scenicq.store.labels`; everything else (columns computed from the map, files, checksums) is the store's. Read next:
`interchange.py`.
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
    "Entry",
    "Importer",
    "Labels",
    "OpenedSource",
    "Options",
    "Reader",
    "read_class_map",
    "read_maps",
]


@dataclass(frozen=True, slots=True)
class Options:
    """What the user may tell every importer.

    Attributes:
        maps: GeoJSON file of each map, in addition to and before those of the source.
        class_map: Class of the tree for class names of the source, before the source's own taxonomy.
        ego: For sources that have no ego: the track that is to be it, "nearest" (in each frame the vehicle nearest to
            the middle of all objects) or "none"; None is "nearest", and is told.
        scratch: Folder for temporary files that must outlive `Importer.read`; its owner removes it.
    """

    maps: Mapping[str, Path] = field(default_factory=dict[str, Path])
    class_map: Mapping[str, str] = field(default_factory=dict[str, str])
    scratch: Path | None = None
    ego: str | None = None


@dataclass(frozen=True, slots=True)
class Entry:
    """A recording of a source that is opened but not read.

    Attributes:
        name: Unique in the source.
        weight: About how many label objects it has.
        digest: Changes with what the source says of it.
    """

    name: str
    weight: int
    digest: str


class Reader(Protocol):
    """Reads some recordings, perhaps in another process: it must be possible to pickle it."""

    def recordings(self, labels: Labels, report: Report) -> Iterator[RecordingColumns]:
        """The recordings in order of their names, each with at least one label.

        Args:
            labels: Checks what must hold between labels.
            report: Takes what is unsound.
        """
        ...


@dataclass(frozen=True, slots=True)
class OpenedSource:
    """An opened source.

    Attributes:
        name: What the source calls itself.
        maps: Elements of each map.
        entries: The recordings in order of their names.
        reader: Gives a reader of some of the recordings, by name.
        frames: Number of labels that the source claims, for progress only.
        context: Changes with everything but maps and recordings that the dataset depends on.
        facts: What the dataset's provenance should say of how values were made.
    """

    name: str
    maps: Mapping[str, tuple[MapFeature, ...]]
    entries: tuple[Entry, ...]
    reader: Callable[[Sequence[str]], Reader]
    frames: int
    context: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def recordings(self, report: Report) -> Iterator[RecordingColumns]:
        """All recordings, one after the other."""
        return self.reader([entry.name for entry in self.entries]).recordings(Labels(self.maps, report), report)


class Importer(Protocol):
    """One dataset format."""

    @property
    def name(self) -> str:
        """What `--format` calls it, one word in lower case."""
        ...

    @property
    def layout(self) -> str:
        """The files by which it recognises a source, for messages."""
        ...

    def recognises(self, path: Path) -> bool:
        """Whether a source is of this format: cheap, and True for no source of another format."""
        ...

    def read(self, path: Path, options: Options, report: Report) -> OpenedSource:
        """Open a source.

        What is unsound goes to the report and is left out; a source that cannot be read at all is an error.

        Raises:
            DataError: `file-missing`, `file-invalid`; with a strict report whatever is unsound.
        """
        ...


class ClassNames:
    """Translates class names of a source into the class tree.

    Attributes:
        known: Class of the tree for each name.
    """

    def __init__(self, known: Mapping[str, str], report: Report) -> None:
        """Take the names that are known: the source's taxonomy and, before it, the user's class map."""
        self.known = known
        self._report = report

    def category(self, name: str) -> str:
        """The class of the tree; `Object`, reported, for a name that nothing lists."""
        if (category := self.known.get(name)) is not None:
            return category
        message = f"class `{name}` is in no taxonomy; its objects become `{ROOT}`"
        near = similar(name.capitalize(), subclasses(ROOT))
        meant = f'"{near}"' if near else "CLASS"
        hint = f'a class map with {{"{name}": {meant}}} gives it a class: `--class-map FILE`'
        self._report.kept("object", "unknown-class", message, name=name, hints=(hint,))
        return ROOT


class Labels:
    """Checks what must hold between labels of a source; each check that fails leaves something out and is reported."""

    def __init__(self, maps: Collection[str], report: Report, taken: Collection[tuple[str, str]] = frozenset()) -> None:
        """Start without labels.

        Args:
            maps: Names of the maps; any other is missing.
            report: Takes what is left out.
            taken: Recording and frame of labels whose name a label of an earlier recording has.
        """
        self._maps = maps
        self._report = report
        self._taken = taken
        self._frames: set[str] = set()

    def recording(self, name: str, labels: Sequence[tuple[Label, str]]) -> RecordingColumns | None:
        """What `sound` makes of plain labels.

        Args:
            name: The name of the recording.
            labels: Each with its place in the source, for messages.
        """
        made = [label for label, _ in labels]
        found = columns_of(Recording(name, made[0].map if made else "", tuple(made)))
        return self.sound(found, [place for _, place in labels], [label.map for label in made])

    def sound(
        self, found: RecordingColumns, places: Sequence[object], maps: Sequence[str] | None = None
    ) -> RecordingColumns | None:
        """The sound labels of a recording, sorted; None if there is none.

        Args:
            found: Its labels in any order.
            places: Where each label is in the source, for messages; a text is made only of what is told.
            maps: The map of each label, if they may differ.
        """
        problems = find_problems(found)
        order: list[int] = []
        times: dict[int, str] = {}
        for number, (frame, time) in enumerate(zip(found.frames, found.times_us, strict=True)):
            if frame in self._frames or (found.name, frame) in self._taken:
                self._leave_out(f"{places[number]}: label id `{frame}` is used twice")
            elif maps is not None and maps[number] != found.map:
                message = f"label `{frame}` has map `{maps[number]}`, its recording began with `{found.map}`"
                self._leave_out(f"{places[number]}: {message}")
            elif time in times:
                message = f"label `{frame}` has the time of label `{times[time]}`"
                self._leave_out(f"{places[number]}: {message} in recording `{found.name}`")
            elif number in problems.labels:
                self._leave_out(f"{places[number]}: label `{frame}` or its ego: {problems.labels[number]}")
            else:
                self._frames.add(frame)
                times[time] = frame
                order.append(number)
        if not order:
            self._report.left_out("recording", "record-invalid", f"recording `{found.name}` has no sound label")
            return None
        if found.map not in self._maps:
            self._tell_missing(found.map, len(order))
        objects, sensors = self._sound_rows(found, problems, places, order)
        order.sort(key=lambda number: (found.times_us[number], found.frames[number]))
        as_it_is = order == list(range(len(found.frames)))
        if as_it_is and objects.all() and sensors.all():
            return found
        return take_labels(found, order, objects, sensors)

    def _tell_missing(self, map_name: str, labels: int) -> None:
        if map_name == NO_MAP:
            message = "labels have no map: no road, lane or direction of traffic is known for them"
            self._report.assumed("map", "no map", message, hints=("`--map none=FILE.geojson` gives one",))
            return
        message = f"map `{map_name}` is not there; its labels are kept without a road network"
        hint = f"`--map {map_name}=FILE.geojson` gives the map"
        for _ in range(labels):
            self._report.kept("label", "map-missing", message, name=map_name, hints=(hint,))

    def _leave_out(self, message: str) -> None:
        self._report.left_out("label", "record-invalid", message)

    def _sound_rows(
        self, found: RecordingColumns, problems: Problems, places: Sequence[object], labels: Sequence[int]
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which objects and sensor files of some labels are sound; what is not is told."""
        ids, tracks = found.objects.id, found.objects.track
        objects = np.ones(len(ids), dtype=bool)
        sensors = np.ones(len(found.paths), dtype=bool)
        ends: list[int] = np.cumsum(found.object_counts).tolist()
        files: list[int] = np.cumsum(found.sensor_counts).tolist()
        for label in labels:
            first, end = ends[label] - int(found.object_counts[label]), ends[label]
            owner, ego = f"of label `{found.frames[label]}`", found.egos.track[label]
            names, known = set(ids[first:end]), [track for track in tracks[first:end] if track is not None]
            odd = len(names) < end - first or "ego" in names or len(set(known)) < len(known) or ego in known
            if odd or not problems.objects.keys().isdisjoint(range(first, end)):
                for row, fact in _unsound(ids, tracks, range(first, end), owner, ego, problems.objects):
                    objects[row] = False
                    self._report.left_out("object", "record-invalid", f"{places[label]}: {fact}")
            for row in range(files[label] - int(found.sensor_counts[label]), files[label]):
                if (problem := problems.sensors.get(row)) is not None:
                    sensors[row] = False
                    message = f"{places[label]}: sensor file `{found.channels[row]}` {owner}: {problem}"
                    self._report.left_out("sensor file", "record-invalid", message)
        return objects, sensors


def _unsound(
    ids: Sequence[str], tracks: Sequence[str | None], rows: range, owner: str, ego: str | None,
    problems: Mapping[int, str],
) -> Iterator[tuple[int, str]]:  # fmt: skip
    """The objects of a label that are left out, and why; of two with one id or one track the first is kept."""
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
        files: File of each map.
        report: Takes what is unsound.

    Raises:
        DataError: `file-missing` or `file-invalid`.
    """
    if not files:
        return {}
    from scenicq.importers.map_files import read_geojson_maps  # noqa: PLC0415 - slow to load, and for maps

    return read_geojson_maps(files, report)


def read_class_map(path: Path) -> dict[str, str]:
    """Read `{class name of the source: class of the tree}`.

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
