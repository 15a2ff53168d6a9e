"""`dataset.json`: what a dataset holds, where it came from and what was left out.

Everything but `provenance` is a function of the source alone, so two runs over one source differ only there.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct, structs

from scenicq.errors import DataError, Diagnostic
from scenicq.store.schema import ADDED_TABLES, SCHEMA_VERSION, SCHEMAS, UPGRADABLE

__all__ = [
    "FOLDERS",
    "MANIFEST",
    "SEGMENTS",
    "Counts",
    "Manifest",
    "MapGroup",
    "Omission",
    "Part",
    "Provenance",
    "Whole",
    "check_path",
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
Whole = Annotated[int, Meta(ge=0, le=2**63 - 1)]
"""What a column of whole numbers holds, if it counts something."""
_Time = Annotated[int, Meta(ge=-(2**63), le=2**63 - 1)]
_Path = Annotated[str, Meta(pattern=r"^[a-z_]+/[A-Za-z0-9][A-Za-z0-9._-]*\.parquet\Z")]
"""Paths of files: no way out of the dataset, no address, no pattern."""


class Part(Struct, frozen=True):
    """One Parquet file of a table: its path relative to the dataset, size, checksum and number of rows."""

    path: _Path
    bytes: Whole
    sha256: str
    rows: Whole


class Counts(Struct, frozen=True):
    """How much there is of something."""

    frames: Whole = 0
    objects: Whole = 0


class MapGroup(Struct, frozen=True):
    """Maps that are alike in all that is known of a map without reading it.

    Attributes:
        kinds: The kinds of their elements, in order.
        directed: Whether traffic has a direction anywhere.
        maps: Their names, in order.
    """

    kinds: tuple[str, ...]
    directed: bool
    maps: tuple[str, ...]


class Omission(Struct, frozen=True):
    """Something that the dataset lacks, or has otherwise than the source.

    Attributes:
        what: "recording", "label", "object", "map element" ...
        code: A key of `scenicq.errors.CODES`.
        count: How many.
        name: What they have in common, such as the unknown class; "" where it does not matter.
        kept: Whether it is in the dataset nevertheless, such as an object of unknown class as `Object`.
    """

    what: str
    code: str
    count: Whole
    name: str = ""
    kept: bool = False


class Provenance(Struct, frozen=True):
    """What may differ between two runs over one source.

    Attributes:
        source: The path that was given.
        time: When, in ISO 8601.
        versions: The versions of packages; None where one is not known.
        options: How the source was read.
        facts: How values were made, as the importer says it.
    """

    source: str = "unknown"
    time: str = "unknown"
    versions: dict[str, str | None] = {}
    options: dict[str, Any] = {}
    facts: dict[str, Any] = {}


class Manifest(Struct, frozen=True, kw_only=True, tag_field="format", tag=_FORMAT):
    """The content of `dataset.json`.

    Attributes:
        schema: Version of the tables.
        name: What the source calls itself.
        importer: Name of the importer that read the source.
        tables: The files of each table.
        maps: Number of elements of each map.
        map_groups: What is known of maps without reading them; earlier programs have not written it.
        total: Frames and label objects of the dataset.
        tracks: Distinct tracks, counted within each recording.
        span_us: First and last timestamp; None without frames.
        by_class: Label objects of each class of the tree (exactly, not below it).
        by_source_class: Label objects of each class name of the source.
        by_map: Frames and label objects of each map that a label refers to.
        by_recording: Frames and label objects of each recording.
        left_out: What the importer left out or kept with a defect.
        provenance: Versions, options, time: all that may differ between two runs over one source.
    """

    schema: Whole = SCHEMA_VERSION
    name: str
    importer: str
    tables: dict[str, tuple[Part, ...]]
    maps: dict[str, Whole]
    total: Counts
    tracks: Whole
    span_us: tuple[_Time, _Time] | None
    by_class: dict[str, Whole]
    by_source_class: dict[str, Whole]
    by_map: dict[str, Counts]
    by_recording: dict[str, Counts]
    map_groups: tuple[MapGroup, ...] = ()
    left_out: tuple[Omission, ...] = ()
    provenance: Provenance = Provenance()

    def __post_init__(self) -> None:
        """Refuse a manifest that lacks a table.

        Raises:
            ValueError: It does.
        """
        later = {name for version, names in ADDED_TABLES.items() if version > self.schema for name in names}
        lacking = [name for name in SCHEMAS if name not in self.tables and name not in later]
        if lacking:
            raise ValueError(f"table {lacking[0]} is missing")

    @property
    def digest(self) -> str:
        """SHA-256 of what all tables hold, in hexadecimal: the version of the dataset."""
        parts = [(name, [part.sha256 for part in parts]) for name, parts in sorted(self.tables.items())]
        return hashlib.sha256(repr(parts).encode()).hexdigest()

    @property
    def named_maps(self) -> tuple[str, ...]:
        """Names of the maps, sorted, including those that labels name and the source lacks."""
        return tuple(sorted({*self.maps, *self.by_map}))

    def to_json(self) -> str:
        """The text of `dataset.json`."""
        return msgspec.json.format(msgspec.json.encode(self), indent=1).decode() + "\n"


class _Head(Struct):
    """What says whether a file is a manifest, and of which version."""

    format: object = None
    schema: object = None


def is_dataset(folder: Path) -> bool:
    """Whether a folder is a dataset of ours, of any version, sound or not."""
    file = folder / MANIFEST
    try:
        # A pipe would never end.
        return file.is_file() and msgspec.json.decode(file.read_bytes(), type=_Head).format == _FORMAT
    except (OSError, msgspec.DecodeError, RecursionError):
        return False


def check_path(folder: Path, code: str) -> None:
    """Refuse a folder whose path is no text: neither Arrow nor DuckDB can open files in it.

    Args:
        folder: The folder of a dataset.
        code: The code of the error.

    Raises:
        DataError: The path has bytes that are not UTF-8, or Python takes it for ASCII.
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
        folder: The dataset's folder, or one in which a dataset grows; it may be a link itself.
    """
    return [folder / name for name in FOLDERS if (folder / name).is_symlink()]


def read_manifest(name: str, data: bytes, *, older: bool = False) -> Manifest:
    """Read a dataset's manifest.

    Args:
        name: What messages call the dataset.
        data: Content of its `dataset.json`.
        older: Whether a version that `scenicq index` brings up to date will do.

    Raises:
        DataError: `store-missing`, `store-version` or `store-damaged`.
    """
    path = f"{name}/{MANIFEST}"
    try:
        head = msgspec.json.decode(data, type=_Head)
    except msgspec.ValidationError:
        head = _Head()
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise _damaged(path, f"is not JSON: {error}") from error
    if head.format != _FORMAT:
        hint = "`scenicq ingest SOURCE DATASET` makes a dataset from a source"
        raise DataError(Diagnostic("store-missing", f"{name} is not a dataset of scenicq", hints=(hint,)))
    found = head.schema
    if found != SCHEMA_VERSION and not (older and found in UPGRADABLE):
        message = f"{name} has tables of version {found}; this program reads version {SCHEMA_VERSION}"
        hint = f"`scenicq index {name}` brings it up to date" if found in UPGRADABLE else "ingest the source again"
        raise DataError(Diagnostic("store-version", message, hints=(hint,)))
    try:
        manifest = msgspec.json.decode(data, type=Manifest)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise _damaged(path, f"is unsound: {error}") from error
    # other tables than those that are known are nobody's
    return structs.replace(
        manifest, tables={each: manifest.tables[each] for each in SCHEMAS if each in manifest.tables}
    )


def _damaged(path: str, what: str) -> DataError:
    return DataError(Diagnostic("store-damaged", f"{path} {what}", hints=("ingest the source again",)))
