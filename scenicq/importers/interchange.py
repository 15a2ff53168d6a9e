"""The interchange folder: the format that any team can write in an afternoon.

- `dataset.json`: {"name", "interchange": 1, "angle": "heading" | "yaw", "classes": "nuscenes" | "scenic" | FILE};
- `labels.jsonl`: one label a line; also `labels-*.jsonl`, either with `.gz`, or `labels.parquet`. An explicit null says
  that there is no ego, or that a heading is not known. Objects may have `z`, `pitch` and `roll`; a sensor is a path, or
  an object with `path` and what `cameras.CAMERA_KEYS` lists;
- `maps/NAME.geojson`: metres of the map's frame.

What is not read is counted (`specifications/interchange.json`, `specifications/geojson.json`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, cast

from scenicq.errors import DataError, Diagnostic
from scenicq.geometry.angles import normalize
from scenicq.geometry.camera import Camera
from scenicq.importers import fields
from scenicq.importers.base import (
    ClassNames,
    Entry,
    Labels,
    OpenedSource,
    Options,
    read_class_map,
    read_maps,
)
from scenicq.importers.cameras import camera_of
from scenicq.importers.ego_choice import ego_facts, viewpoint
from scenicq.importers.fields import NO_MAP, InvalidError, Record
from scenicq.importers.folders import first_files, read_bytes, readable
from scenicq.importers.grouped_lines import GroupedLines, group_lines
from scenicq.importers.interchange_columns import read_columns
from scenicq.importers.layouts import is_interchange
from scenicq.importers.recording_checks import radians, tell_order
from scenicq.importers.report import Report
from scenicq.importers.specification import specification
from scenicq.store.classes import taxonomy, taxonomy_names
from scenicq.store.columns import OUT_OF_PLANE, RecordingColumns
from scenicq.store.labels import Label, LabelObject, OutOfPlane, Recording
from scenicq.store.wkb import FARTHEST_M

__all__ = ["Interchange", "LineReader"]

_VERSION = 1
_OBJECT_BYTES = 200
"""About what an object takes in a line."""

_LABEL_FILES = ("labels.jsonl", "labels-*.jsonl", "labels.jsonl.gz", "labels-*.jsonl.gz", "labels.parquet")


class Interchange:
    """Importer of interchange folders.

    Attributes:
        columnar: Whether recordings without a defect are read by column; the result is the same.
    """

    columnar = True
    name = "interchange"
    layout = 'a `dataset.json` with `"interchange": 1`, and `labels.jsonl`'

    def recognises(self, path: Path) -> bool:
        """Whether `dataset.json` has the key `interchange`."""
        return is_interchange(path)

    def read(self, path: Path, options: Options, report: Report) -> OpenedSource:
        """Open an interchange folder.

        Raises:
            DataError: `file-missing` or `file-invalid`; with a strict report whatever is unsound.
            ValueError: Labels are packed, and `options` has no scratch folder.
        """
        header = _header(path)
        specification("interchange").count_rows((header,), report, "dataset.json")
        angle = header.get("angle")
        if angle not in ("heading", "yaw"):
            raise _invalid(path, '`angle` must be "heading" or "yaw"')
        classes = {**_taxonomy(path, header.get("classes")), **options.class_map}
        files = sorted({file for pattern in _LABEL_FILES for file in first_files(path, pattern)})
        if not files:
            raise DataError(Diagnostic("file-missing", f"{path} has none of {', '.join(_LABEL_FILES)}"))
        found = {readable(file.stem): file for file in first_files(path, "maps/*.geojson")}
        maps = read_maps({**found, **options.maps}, report)
        lines, about, count = group_lines(files, options.scratch, report)
        name = header.get("name")
        return OpenedSource(
            name=name if isinstance(name, str) and name else readable(path.resolve().name),
            maps=maps,
            entries=tuple(Entry(name, size // _OBJECT_BYTES, digest) for name, (size, digest) in about.items()),
            reader=lambda names: LineReader(lines.of(names), classes, angle == "yaw", columnar=self.columnar),
            frames=count,
            context=json.dumps([angle, sorted(classes.items())]),
            facts=_facts(header),
        )


@dataclass(frozen=True, slots=True)
class LineReader:
    """Reads some recordings of an interchange folder.

    Attributes:
        lines: Where they lie.
        classes: Class of the tree for each class name.
        yaw: Whether angles are counted from +x.
        columnar: Whether recordings without a defect are read by column, several times faster.
    """

    lines: GroupedLines
    classes: Mapping[str, str]
    yaw: bool
    columnar: bool = True

    def recordings(self, labels: Labels, report: Report) -> Iterator[Recording | RecordingColumns]:
        """The recordings in order of their names."""
        turn = -math.pi / 2 if self.yaw else 0.0
        for name in self.lines.runs:
            lines = list(self.lines.read(name))
            columns = None
            contents = [content for text, _ in lines if (content := _parsed(text)) is not None]
            _count(contents, "yaw" if self.yaw else "heading", report)
            for times in _times_by_file(lines, contents) if len(contents) == len(lines) else ():
                tell_order(name, times, report, numbered=False)
            if self.columnar and len(contents) == len(lines):
                columns = read_columns(contents, name, self.classes, yaw=self.yaw)
            if columns is not None and labels.accept(columns):
                yield columns
                continue
            reader = _LabelReader(ClassNames(self.classes, report), turn, report)
            if (recording := labels.recording(name, list(reader.labels(lines, name)))) is not None:
                yield recording


def _parsed(text: bytes) -> dict[str, Any] | None:
    """The object of a line; None where there is none, as is told when the line is read."""
    try:
        content = fields.parse_json(text)
    except InvalidError:
        return None
    return cast("dict[str, Any]", content) if isinstance(content, dict) else None


def _count(lines: Sequence[dict[str, Any]], angle: str, report: Report) -> None:
    """Count what is not read of some lines; the angle that `dataset.json` does not name is such."""
    known = specification("interchange")
    known.count_rows(lines, report, "labels")
    other = "yaw" if angle == "heading" else "heading"
    for line in lines:
        members: dict[str, list[Any]] = {"ego": [line.get("ego")], "objects": _list(line.get("objects"))}
        for name, entries in members.items():
            rows = [cast("dict[str, Any]", entry) for entry in entries if isinstance(entry, dict)]
            known.count_rows(rows, report, f"labels/{name}")
            report.not_read(f"labels/{name}/{other}", sum(other in row for row in rows))
            for row in rows:
                if isinstance(value := row.get(angle), int | float):
                    radians(value, report)
        if isinstance(sensors := line.get("sensors"), dict):
            cameras = [cast("dict[str, Any]", each) for each in cast("dict[str, Any]", sensors).values()
                       if isinstance(each, dict)]  # fmt: skip
            known.count_rows(cameras, report, "labels/sensors/*")


def _times_by_file(lines: Sequence[tuple[bytes, str]], contents: Sequence[dict[str, Any]]) -> Iterator[list[int]]:
    """Times of the labels of a recording in the order of each file that has some of them."""
    for _, pairs in groupby(zip(lines, contents, strict=True), lambda pair: pair[0][1].rpartition(":")[0]):
        yield [time for _, content in pairs if isinstance(time := content.get("timestamp_us"), int)]


def _list(value: object) -> list[Any]:
    return cast("list[Any]", value) if isinstance(value, list) else []


class _LabelReader:
    """From a parsed line to a label."""

    def __init__(self, classes: ClassNames, turn: float, report: Report) -> None:
        self._classes = classes
        self._turn = turn
        self._angle = "heading" if turn == 0 else "yaw"
        self._report = report

    def labels(self, lines: Sequence[tuple[bytes, str]], recording: str) -> Iterator[tuple[Label, str]]:
        """The sound labels of some lines, with their places."""
        for text, place in lines:
            try:
                content = fields.parse_json(text)
            except InvalidError as error:
                self._report.left_out("label", "file-invalid", f"{place}: {error}")
                continue
            try:
                yield self.label(content, recording, place), place
            except InvalidError as error:
                self._report.left_out("label", "record-invalid", f"{place}: {error}")

    def label(self, content: object, recording: str, place: str) -> Label:
        line = fields.record(content, "the line")
        frame = fields.text(line, "id")
        try:
            if fields.text(line, "recording") != recording:
                raise InvalidError("`recording` is ambiguous")
            objects = tuple(self._objects(fields.items(line, "objects"), frame, place))
            if "ego" in line and line["ego"] is None:
                ego = viewpoint(objects)
                if ego is None:
                    raise InvalidError("there is neither an ego nor an object")
            else:
                ego = self._ego(fields.record(line.get("ego"), "`ego`"), f"{place}: ego of label `{frame}`")
            return Label(
                frame=frame,
                recording=recording,
                timestamp_us=fields.integer(line, "timestamp_us"),
                map=NO_MAP if line.get("map") is None else fields.text(line, "map"),
                ego=ego,
                objects=objects,
                params=fields.scalars(line, "params", self._attribute(f"{place}: label `{frame}`")),
                sensors=_sensors(line),
                cameras=dict(self._cameras(line, frame, place)),
            )
        except InvalidError as error:
            raise InvalidError(f"label `{frame}`: {error}") from error

    def _cameras(self, line: Record, frame: str, place: str) -> Iterator[tuple[str, Camera]]:
        """The cameras of a line; one that cannot be is left out."""
        for channel, sensor in fields.optional_record(line, "sensors").items():
            if isinstance(sensor, dict):
                try:
                    camera = camera_of(cast(Record, sensor))
                except InvalidError as error:
                    message = f"{place}: camera `{channel}` of label `{frame}`: {error}"
                    self._report.left_out("camera", "record-invalid", message)
                else:
                    if camera is not None:
                        yield channel, camera

    def _ego(self, entry: Record, place: str) -> LabelObject:
        try:
            return self._object(entry, "ego", fields.optional_text(entry, "class"), place)
        except InvalidError as error:
            raise InvalidError(f"ego: {error}") from error

    def _objects(self, entries: list[Any], frame: str, place: str) -> Iterator[LabelObject]:
        for number, value in enumerate(entries):
            name = f"number {number}"
            try:
                entry = fields.record(value, "it")
                id = fields.text(entry, "id")
                name = f"`{id}`"
                where = f"{place}: object {name} of label `{frame}`"
                yield self._object(entry, id, fields.text(entry, "class"), where)
            except InvalidError as error:
                message = f"{place}: object {name} of label `{frame}`: {error}"
                self._report.left_out("object", "record-invalid", message)

    def _object(self, entry: Record, id: str, source_class: str | None, place: str) -> LabelObject:
        x, y = fields.vector(entry, "position", 2)
        # Null says that it is not known; a key that is missing is more likely misspelt.
        known = entry.get(self._angle, ...) is not None
        heading = normalize(fields.number(entry, self._angle) + self._turn) if known else None
        velocity = fields.vector(entry, "velocity", 2) if entry.get("velocity") is not None else None
        return LabelObject(
            id=id,
            source_class=source_class or "",
            x=x,
            y=y,
            heading=heading,
            width=fields.positive(entry, "width"),
            length=fields.positive(entry, "length"),
            height=fields.positive(entry, "height"),
            velocity=None if velocity is None else (velocity[0], velocity[1]),
            track=fields.optional_text(entry, "track"),
            attributes=fields.scalars(entry, "attributes", self._attribute(place)),
            out_of_plane=_out_of_plane(entry),
            # Last: an object that is left out must not count as one of unknown class.
            category="Car" if source_class is None else self._classes.category(source_class),
        )

    def _attribute(self, place: str) -> Callable[[str], None]:
        return lambda problem: self._report.left_out("attribute", "record-invalid", f"{place}: {problem}")


def _sensors(line: Record) -> dict[str, str]:
    if line.get("sensors") is None:
        return {}
    sensors = fields.record(line["sensors"], "`sensors`")
    return {
        channel: fields.text(cast(Record, sensor), "path")
        if isinstance(sensor, dict)
        else fields.text(sensors, channel)
        for channel, sensor in sensors.items()
    }


def _out_of_plane(entry: Record) -> OutOfPlane | None:
    z, *turns = (fields.optional_number(entry, name) for name in OUT_OF_PLANE)
    if z is not None and abs(z) > FARTHEST_M:
        raise InvalidError("`z` is at no place on a map")
    pitch, roll = (None if angle is None else normalize(angle) for angle in turns)
    return None if z is pitch is roll is None else OutOfPlane(z, pitch, roll)


def _invalid(folder: Path, message: str) -> DataError:
    return DataError(Diagnostic("file-invalid", f"{folder / 'dataset.json'}: {message}"))


def _header(folder: Path) -> Record:
    try:
        content = fields.parse_json(read_bytes(folder / "dataset.json"))
    except OSError as error:
        message = f"{folder / 'dataset.json'} cannot be read: {error.strerror}"
        raise DataError(Diagnostic("file-missing", message)) from error
    except InvalidError as error:
        raise _invalid(folder, str(error)) from error
    if not isinstance(content, dict):
        raise _invalid(folder, "not an object")
    header = cast(Record, content)
    if header.get("interchange") != _VERSION:
        raise _invalid(folder, f"`interchange` must be {_VERSION}")
    return header


def _facts(header: Record) -> dict[str, str]:
    said = {"source": text} if isinstance(text := header.get("source"), str) else {}
    return said | (ego_facts("none") if header.get("ego") == "none" else {})


def _taxonomy(folder: Path, name: object) -> Mapping[str, str]:
    if not isinstance(name, str) or not name:
        raise _invalid(folder, '`classes` must be "nuscenes", "scenic" or a file of the folder')
    if name in taxonomy_names():
        return taxonomy(name)
    try:
        file = (folder / name).resolve()
    except (OSError, ValueError) as error:
        raise _invalid(folder, "`classes` names no file") from error
    if not file.is_relative_to(folder.resolve()):
        raise _invalid(folder, "`classes` names a file outside of the folder")
    return read_class_map(file)
