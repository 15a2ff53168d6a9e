"""`dataset.json`: what a dataset holds, where it came from and what was left out.

Everything but `provenance` is a function of the source alone, so two runs over one source differ only there.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, cast

from scenicq.errors import DataError, Diagnostic
from scenicq.store.schema import SCHEMA_VERSION, SCHEMAS, UPGRADABLE

__all__ = [
    "FOLDERS",
    "MANIFEST",
    "SEGMENTS",
    "Counts",
    "LeftOut",
    "Manifest",
    "Part",
    "check_path",
    "fields_of",
    "find_links",
    "is_dataset",
    "read_manifest",
]

MANIFEST = "dataset.json"
"""Name of the manifest's file."""

SEGMENTS = "segments"
"""Name of the folder with descriptions of segments."""
FOLDERS = (*SCHEMAS, SEGMENTS)
"""Names of all folders of a dataset."""

_FORMAT = "scenicq"
_LARGEST = 1 << 63
"""What a column of whole numbers holds less than."""
_PLAIN = re.compile(r"[a-z_]+/[A-Za-z0-9][A-Za-z0-9._-]*\.parquet", re.ASCII)
"""Paths of files: no way out of the dataset, no address, no pattern."""


@dataclass(frozen=True, slots=True)
class Part:
    """One Parquet file of a table: its path relative to the dataset, size, checksum and number of rows."""

    path: str
    bytes: int
    sha256: str
    rows: int


@dataclass(frozen=True, slots=True)
class Counts:
    """How much there is of something."""

    frames: int = 0
    objects: int = 0


@dataclass(frozen=True, slots=True)
class LeftOut:
    """What is not in the dataset as the source has it.

    Attributes:
        what: "recording", "label", "object", "map element" ...
        code: A key of `scenicq.errors.CODES`.
        count: How many.
        name: What they have in common, such as the unknown class; "" where it does not matter.
        kept: Whether it is in the dataset nevertheless, such as an object of unknown class as `Object`.
    """

    what: str
    code: str
    count: int
    name: str = ""
    kept: bool = False


@dataclass(frozen=True, slots=True)
class Manifest:
    """The content of `dataset.json`.

    Attributes:
        name: What the source calls itself.
        importer: Name of the importer that read the source.
        tables: The files of each table.
        maps: Number of elements of each map.
        total: Frames and label objects of the dataset.
        tracks: Distinct tracks, counted within each recording.
        span_us: First and last timestamp; None without frames.
        by_class: Label objects of each class of the tree (exactly, not below it).
        by_source_class: Label objects of each class name of the source.
        by_map: Frames and label objects of each map that a label refers to.
        by_recording: Frames and label objects of each recording.
        left_out: What the importer left out or kept with a defect.
        provenance: Versions, options, time: all that may differ between two runs over one source.
        schema: Version of the tables.
    """

    name: str
    importer: str
    tables: Mapping[str, tuple[Part, ...]]
    maps: Mapping[str, int]
    total: Counts
    tracks: int
    span_us: tuple[int, int] | None
    by_class: Mapping[str, int]
    by_source_class: Mapping[str, int]
    by_map: Mapping[str, Counts]
    by_recording: Mapping[str, Counts]
    left_out: tuple[LeftOut, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict[str, Any])
    schema: int = SCHEMA_VERSION

    @property
    def digest(self) -> str:
        """SHA-256 of what all tables hold, in hexadecimal: the version of the dataset."""
        parts = [(name, [part.sha256 for part in parts]) for name, parts in sorted(self.tables.items())]
        return hashlib.sha256(repr(parts).encode()).hexdigest()

    def to_json(self) -> str:
        """The text of `dataset.json`."""
        content = {"format": _FORMAT, "schema": self.schema} | fields_of(self)
        return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False, default=fields_of) + "\n"


def fields_of(value: Any) -> dict[str, Any]:
    """The fields of a dataclass by name, not copied: what `json.dumps` is to write for one."""
    return {each.name: getattr(value, each.name) for each in fields(value)}


def is_dataset(folder: Path) -> bool:
    """Whether a folder is a dataset of ours, of any version, sound or not."""
    file = folder / MANIFEST
    try:
        # A pipe would never end.
        content = json.loads(file.read_bytes()) if file.is_file() else None
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(content, dict) and cast(dict[str, object], content).get("format") == _FORMAT


def check_path(folder: Path, code: str) -> None:
    """Refuse a folder whose path is no text: neither Arrow nor DuckDB open files in it.

    Args:
        folder: The folder of a dataset.
        code: The code of the error.

    Raises:
        DataError: It is none, as where a path has bytes that are not UTF-8, or Python takes it for ASCII.
    """
    try:
        str(folder.absolute()).encode()
    except UnicodeEncodeError as error:
        message = f"the path of {folder} is not text in UTF-8, and no other can hold a dataset"
        hints = ("PYTHONUTF8=1 or a locale of UTF-8 has Python take paths for UTF-8", "else give it another name")
        raise DataError(Diagnostic(code, message, hints=hints)) from error


def find_links(folder: Path) -> list[Path]:
    """Folders of a dataset that are links: what is read or written there belongs to somebody else.

    Args:
        folder: Of the dataset, or one in which a dataset grows; it may be a link itself.
    """
    return [folder / name for name in FOLDERS if (folder / name).is_symlink()]


def read_manifest(name: str, data: bytes, *, older: bool = False) -> Manifest:
    """Read a dataset's manifest.

    Args:
        name: Of the dataset, for messages.
        data: Content of its `dataset.json`.
        older: Whether a version that `scenicq index` brings up to date will do.

    Raises:
        DataError: `store-missing`, `store-version` or `store-damaged`.
    """
    path = f"{name}/{MANIFEST}"
    try:
        content = json.loads(data.decode())
    except UnicodeDecodeError as error:
        raise _damaged(path, "is not UTF-8 text") from error
    except (ValueError, RecursionError) as error:
        raise _damaged(path, f"is not JSON: {error}") from error
    if not isinstance(content, dict) or cast(dict[str, object], content).get("format") != _FORMAT:
        hint = "`scenicq ingest SOURCE DATASET` makes a dataset from a source"
        raise DataError(Diagnostic("store-missing", f"{name} is not a dataset of scenicq", hints=(hint,)))
    fields = cast(dict[str, Any], content)
    found = fields.get("schema")
    if found != SCHEMA_VERSION and not (older and found in UPGRADABLE):
        message = f"{name} has tables of version {found}; this program reads version {SCHEMA_VERSION}"
        hint = f"`scenicq index {name}` brings it up to date" if found in UPGRADABLE else "ingest the source again"
        raise DataError(Diagnostic("store-version", message, hints=(hint,)))
    try:
        return _manifest(fields)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise _damaged(path, f"lacks or has an unsound {error}") from error


def _damaged(path: str, what: str) -> DataError:
    return DataError(Diagnostic("store-damaged", f"{path} {what}", hints=("ingest the source again",)))


def _manifest(content: dict[str, Any]) -> Manifest:
    tables = {name: tuple(_part(part) for part in content["tables"][name]) for name in SCHEMAS}
    span = content["span_us"]
    return Manifest(
        name=_text(content["name"]),
        importer=_text(content["importer"]),
        tables=tables,
        maps=_numbers(content["maps"]),
        total=_counts(content["total"]),
        tracks=_whole(content["tracks"]),
        span_us=None if span is None else (_time(span[0]), _time(span[1])),
        by_class=_numbers(content["by_class"]),
        by_source_class=_numbers(content["by_source_class"]),
        by_map={name: _counts(counts) for name, counts in content["by_map"].items()},
        by_recording={name: _counts(counts) for name, counts in content["by_recording"].items()},
        left_out=tuple(_left_out(entry) for entry in content["left_out"]),
        provenance=_provenance(content["provenance"]),
        schema=_whole(content["schema"]),
    )


def _part(fields: dict[str, Any]) -> Part:
    part = Part(**fields)
    if not _PLAIN.fullmatch(part.path):
        raise ValueError(f"path {part.path}")
    _whole(part.bytes)
    _whole(part.rows)
    _text(part.sha256)
    return part


def _counts(fields: dict[str, Any]) -> Counts:
    counts = Counts(**fields)
    _whole(counts.frames)
    _whole(counts.objects)
    return counts


def _left_out(fields: dict[str, Any]) -> LeftOut:
    entry = LeftOut(**fields)
    for text in (entry.what, entry.code, entry.name):
        _text(text)
    _whole(entry.count)
    if not isinstance(entry.kept, bool):  # pyright: ignore[reportUnnecessaryIsInstance] - a stranger's
        raise ValueError(f"kept: {entry.kept}")
    return entry


def _provenance(value: Any) -> Mapping[str, Any]:
    """Anything, but that what messages are made of has the form that they need."""
    given = cast("dict[str, Any]", value)
    for key in ("source", "time"):
        _text(given.get(key, ""))
    for key in ("versions", "facts"):
        for name, each in cast("dict[str, Any]", given.get(key) or {}).items():
            _text(name)
            if key == "versions":
                _text(each)
    return given


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError(f"text: {str(value)[:40]}")
    return value


def _whole(value: Any) -> int:
    if type(value) is not int or not 0 <= value < _LARGEST:
        raise ValueError(f"number: {str(value)[:40]}")
    return value


def _time(value: Any) -> int:
    if type(value) is not int or not -_LARGEST <= value < _LARGEST:
        raise ValueError(f"time: {str(value)[:40]}")
    return value


def _numbers(value: dict[str, Any]) -> dict[str, int]:
    return {name: _whole(number) for name, number in value.items()}
