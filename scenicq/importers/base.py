"""What an importer is, and what all importers share: options, classes, maps, checks of labels.

An importer knows one dataset format. It yields plain labels in the conventions of `scenicq.store.labels`; everything
else (columns computed from the map, files, checksums) is the store's. Read next: `interchange.py`.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol, cast

from scenicq.errors import DataError, Diagnostic
from scenicq.geometry.features import MapFeature, ProblemSink, dangling, read_geojson
from scenicq.importers.fields import InvalidError, check_characters, parse_json
from scenicq.importers.report import Report
from scenicq.store.classes import ROOT, is_class
from scenicq.store.labels import Label, LabelObject, Recording

__all__ = [
    "ClassNames",
    "Importer",
    "Labels",
    "Options",
    "Source",
    "read_class_map",
    "read_maps",
]


@dataclass(frozen=True, slots=True)
class Options:
    """What the user may tell every importer.

    Attributes:
        maps: GeoJSON file of each map, in addition to and before those of the source.
        class_map: Class of the tree for class names of the source, before the source's own taxonomy.
    """

    maps: Mapping[str, Path] = field(default_factory=dict[str, Path])
    class_map: Mapping[str, str] = field(default_factory=dict[str, str])


@dataclass(frozen=True, slots=True)
class Source:
    """An opened source.

    Attributes:
        name: What the source calls itself.
        maps: Elements of each map.
        recordings: In order of their names, each with at least one label; read while one iterates.
        frames: Number of labels that the source claims, for progress only.
        facts: What the dataset's provenance should say of how values were made.
    """

    name: str
    maps: Mapping[str, tuple[MapFeature, ...]]
    recordings: Generator[Recording]
    frames: int
    facts: Mapping[str, Any] = field(default_factory=dict[str, Any])


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

    def read(self, path: Path, options: Options, report: Report) -> Source:
        """Open a source.

        What is unsound goes to the report and is left out; a source that cannot be read at all is an error.

        Raises:
            DataError: `file-missing`, `file-invalid`; with a strict report whatever is unsound.
        """
        ...


class ClassNames:
    """Translates class names of a source into the class tree."""

    def __init__(self, taxonomy: Mapping[str, str], options: Options, report: Report) -> None:
        """Combine the source's taxonomy with the user's class map, which comes first."""
        self._classes = {**taxonomy, **options.class_map}
        self._report = report

    def category(self, name: str) -> str:
        """The class of the tree; `Object`, reported, for a name that nothing lists."""
        if (category := self._classes.get(name)) is not None:
            return category
        message = f"class `{name}` is in no taxonomy; its objects become `{ROOT}`"
        hint = f'a class map with {{"{name}": CLASS}} gives it a class: `--class-map FILE`'
        self._report.kept("object", "unknown-class", message, name=name, hints=(hint,))
        return ROOT


class Labels:
    """Checks what must hold between labels of a source; each check that fails leaves something out and is reported."""

    def __init__(self, maps: Mapping[str, object], report: Report) -> None:
        """Start without labels; a map that is not among `maps` is missing."""
        self._maps = maps
        self._report = report
        self._frames: set[str] = set()

    def recording(self, name: str, labels: Sequence[tuple[Label, str]]) -> Recording | None:
        """A recording of the sound labels, sorted; None if there is none.

        Args:
            name: Of the recording.
            labels: Each with its place in the source, for messages.
        """
        sound: list[Label] = []
        times: dict[int, str] = {}
        map_name = labels[0][0].map if labels else ""
        for label, place in labels:
            if label.frame in self._frames:
                self._leave_out(f"{place}: label id `{label.frame}` is used twice")
            elif label.map != map_name:
                message = f"label `{label.frame}` has map `{label.map}`, its recording began with `{map_name}`"
                self._leave_out(f"{place}: {message}")
            elif label.timestamp_us in times:
                message = f"label `{label.frame}` has the time of label `{times[label.timestamp_us]}`"
                self._leave_out(f"{place}: {message} in recording `{name}`")
            else:
                self._frames.add(label.frame)
                times[label.timestamp_us] = label.frame
                sound.append(self._without_duplicates(label, place))
        if not sound:
            self._report.left_out("recording", "record-invalid", f"recording `{name}` has no sound label")
            return None
        if map_name not in self._maps:
            self._tell_missing(map_name, len(sound))
        sound.sort(key=lambda label: (label.timestamp_us, label.frame))
        return Recording(name, map_name, tuple(sound))

    def _tell_missing(self, map_name: str, labels: int) -> None:
        message = f"map `{map_name}` is not there; its labels are kept without a road network"
        hint = f"`--map {map_name}=FILE.geojson` gives the map"
        for _ in range(labels):
            self._report.kept("label", "map-missing", message, name=map_name, hints=(hint,))

    def _leave_out(self, message: str) -> None:
        self._report.left_out("label", "record-invalid", message)

    def _without_duplicates(self, label: Label, place: str) -> Label:
        ids = {"ego"}
        sound: list[LabelObject] = []
        for member in label.objects:
            if member.id in ids:
                why = "is kept for the ego" if member.id == "ego" else "is used twice"
                message = f"{place}: object id `{member.id}` of label `{label.frame}` {why}"
                self._report.left_out("object", "record-invalid", message)
            else:
                ids.add(member.id)
                sound.append(member)
        if len(sound) == len(label.objects):
            return label
        return replace(label, objects=tuple(sound))


def read_maps(files: Mapping[str, Path], report: Report) -> dict[str, tuple[MapFeature, ...]]:
    """Read GeoJSON maps.

    Args:
        files: File of each map.
        report: Takes what is unsound.

    Raises:
        DataError: `file-missing` or `file-invalid`.
    """
    maps: dict[str, tuple[MapFeature, ...]] = {}
    for name in sorted(files):
        problems: list[tuple[str, str]] = []
        features = read_geojson(files[name], _collector(problems))
        references = set(dangling(features))
        for problem in problems:
            message = f"{files[name].name}: element `{problem[0]}`: {problem[1]}"
            tell = report.kept if problem in references else report.left_out
            tell("map element", "map-invalid", message)
        maps[name] = tuple(feature for feature in features if _storable(feature, files[name].name, report))
    return maps


def _collector(problems: list[tuple[str, str]]) -> ProblemSink:
    return lambda id, problem: problems.append((id, problem))


def _storable(feature: MapFeature, file: str, report: Report) -> bool:
    try:
        check_characters([feature.id, feature.kind, dict(feature.properties)])
    except InvalidError as error:
        report.left_out("map element", "map-invalid", f"{file}: element {feature.id!a}: {error}")
        return False
    return True


def read_class_map(path: Path) -> dict[str, str]:
    """Read `{class name of the source: class of the tree}`.

    Raises:
        DataError: `file-missing`, `file-invalid`, or `unknown-class` for a class that the tree lacks.
    """
    try:
        content = parse_json(path.read_bytes())
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
