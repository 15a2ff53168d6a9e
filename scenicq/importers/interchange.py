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
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import cast

from scenicq.errors import DataError, Diagnostic
from scenicq.importers import fields
from scenicq.importers.base import (
    ClassNames,
    ImportOptions,
    LabelChecker,
    OpenedSource,
    RecordingEntry,
    read_class_map,
    read_maps,
)
from scenicq.importers.ego_choice import ego_facts
from scenicq.importers.fields import InvalidError, Record
from scenicq.importers.folders import first_files, read_bytes, readable
from scenicq.importers.grouped_lines import GroupedLines, group_lines
from scenicq.importers.interchange_labels import LabelLines
from scenicq.importers.layouts import is_interchange
from scenicq.importers.recording_checks import check_order
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification
from scenicq.store.classes import taxonomy, taxonomy_names
from scenicq.store.columns import RecordingColumns

__all__ = ["Interchange", "LineReader"]

_VERSION = 1
_OBJECT_BYTES = 200
"""About what an object takes in a line."""

_LABEL_FILES = ("labels.jsonl", "labels-*.jsonl", "labels.jsonl.gz", "labels-*.jsonl.gz", "labels.parquet")


class Interchange:
    """Importer of interchange folders."""

    name = "interchange"
    layout = 'a `dataset.json` with `"interchange": 1`, and `labels.jsonl`'

    def recognises(self, path: Path) -> bool:
        """Whether `dataset.json` has the key `interchange`."""
        return is_interchange(path)

    def read(self, path: Path, options: ImportOptions, report: Report) -> OpenedSource:
        """Open an interchange folder.

        Raises:
            DataError: `file-missing` or `file-invalid`; with a strict report whatever is unsound.
            ValueError: Labels are packed, and `options` has no scratch folder.
        """
        header = _header(path)
        load_specification("interchange").count_rows((header,), report, "dataset.json")
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
            entries=tuple(
                RecordingEntry(name, size // _OBJECT_BYTES, digest) for name, (size, digest) in about.items()
            ),
            reader=lambda names: LineReader(lines.of(names), classes, angle),
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
        angle: The field of a turn: `heading`, or `yaw`, which is counted from +x.
    """

    lines: GroupedLines
    classes: Mapping[str, str]
    angle: str

    def recordings(self, labels: LabelChecker, report: Report) -> Iterator[RecordingColumns]:
        """The recordings in order of their names."""
        classes = ClassNames(self.classes, report)
        for name in self.lines.runs:
            read = LabelLines(name, classes, self.angle, report)
            for text, place in self.lines.read(name):
                read.add(text, place)
            for _, pairs in groupby(zip(read.places, read.times_us, strict=True), _file):
                check_order(name, [time for _, time in pairs], report, numbered=False)
            if (found := labels.check_columns(read.columns(), read.places, read.maps)) is not None:
                yield found


def _file(label: tuple[str, int]) -> str:
    """The file of a label with its place."""
    return label[0].rpartition(":")[0]


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
