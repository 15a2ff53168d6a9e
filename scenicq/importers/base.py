"""What an importer is, and what all importers share: options, classes, maps, checks of labels.

An importer knows one dataset format. It yields plain labels in the conventions of `scenicq.store.labels`; everything
else (columns computed from the map, files, checksums) is the store's. Read next: `interchange.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.fields import NO_MAP, InvalidError, parse_json
from scenicq.importers.folders import read_bytes
from scenicq.importers.report import Report
from scenicq.store.classes import ROOT, is_class
from scenicq.store.columns import RecordingColumns, columns_of, second_of_track
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.value_rules import find_problems

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

_Facts = Sequence[str | None]
"""What is wrong with each of some things; None where nothing is."""


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

    def recordings(self, labels: Labels, report: Report) -> Iterator[Recording | RecordingColumns]:
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

    def recordings(self, report: Report) -> Iterator[Recording | RecordingColumns]:
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
        hint = f'a class map with {{"{name}": CLASS}} gives it a class: `--class-map FILE`'
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

    def accept(self, recording: RecordingColumns) -> bool:
        """Take a recording whose labels are sound in themselves, if no name is used twice and all is on a map.

        Args:
            recording: The recording.
        """
        name, map_name, frames = recording.name, recording.map, recording.frames
        if find_problems(recording) or second_of_track(recording) is not None:
            return False
        unique = set(frames)
        if len(unique) < len(frames) or unique & self._frames or any((name, frame) in self._taken for frame in frames):
            return False
        self._frames |= unique
        if map_name not in self._maps:
            self._tell_missing(map_name, len(frames))
        return True

    def recording(self, name: str, labels: Sequence[tuple[Label, str]]) -> Recording | None:
        """A recording of the sound labels, sorted; None if there is none.

        Args:
            name: Of the recording.
            labels: Each with its place in the source, for messages.
        """
        sound: list[Label] = []
        times: dict[int, str] = {}
        map_name = labels[0][0].map if labels else ""
        problems = find_problems(columns_of(Recording(name, map_name, tuple(label for label, _ in labels))))
        first_object = first_sensor = 0
        for number, (label, place) in enumerate(labels):
            objects, sensors = first_object, first_sensor
            first_object, first_sensor = objects + len(label.objects), sensors + len(label.sensors)
            if label.frame in self._frames or (name, label.frame) in self._taken:
                self._leave_out(f"{place}: label id `{label.frame}` is used twice")
            elif label.map != map_name:
                message = f"label `{label.frame}` has map `{label.map}`, its recording began with `{map_name}`"
                self._leave_out(f"{place}: {message}")
            elif label.timestamp_us in times:
                message = f"label `{label.frame}` has the time of label `{times[label.timestamp_us]}`"
                self._leave_out(f"{place}: {message} in recording `{name}`")
            elif number in problems.labels:
                self._leave_out(f"{place}: label `{label.frame}` or its ego: {problems.labels[number]}")
            else:
                self._frames.add(label.frame)
                times[label.timestamp_us] = label.frame
                of_objects = [problems.objects.get(objects + row) for row in range(len(label.objects))]
                of_sensors = [problems.sensors.get(sensors + row) for row in range(len(label.sensors))]
                sound.append(self._with_sound_objects(label, of_objects, of_sensors, place))
        if not sound:
            self._report.left_out("recording", "record-invalid", f"recording `{name}` has no sound label")
            return None
        if map_name not in self._maps:
            self._tell_missing(map_name, len(sound))
        sound.sort(key=lambda label: (label.timestamp_us, label.frame))
        return Recording(name, map_name, tuple(sound))

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

    def _with_sound_objects(self, label: Label, of_objects: _Facts, of_sensors: _Facts, place: str) -> Label:
        """A label without the objects and sensor files of which something is wrong."""
        ids = {"ego"}
        tracks: dict[str, str] = {} if label.ego.track is None else {label.ego.track: "ego"}
        sound: list[LabelObject] = []
        owner = f"of label `{label.frame}`"
        for member, fact in zip(label.objects, of_objects, strict=True):
            problem = fact
            if problem is None and member.track is not None and member.track in tracks:
                problem = f"has the track `{member.track}` of object `{tracks[member.track]}`, which is kept"
            if member.id in ids:
                why = "is kept for the ego" if member.id == "ego" else "is used twice"
                self._report.left_out("object", "record-invalid", f"{place}: object id `{member.id}` {owner} {why}")
            elif problem is not None:
                self._report.left_out("object", "record-invalid", f"{place}: object `{member.id}` {owner}: {problem}")
            else:
                ids.add(member.id)
                tracks |= {} if member.track is None else {member.track: member.id}
                sound.append(member)
        sensors = dict(label.sensors)
        for channel, problem in zip(label.sensors, of_sensors, strict=True):
            if problem is not None:
                del sensors[channel]
                message = f"{place}: sensor file `{channel}` {owner}: {problem}"
                self._report.left_out("sensor file", "record-invalid", message)
        if len(sound) == len(label.objects) and len(sensors) == len(label.sensors):
            return label
        return replace(label, objects=tuple(sound), sensors=sensors)


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
