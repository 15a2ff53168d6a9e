"""The formats of results: each writer takes results one by one and writes what it can at once."""

# pyarrow has no type stubs.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping
from typing import Any, BinaryIO, Protocol

import pyarrow as pa
import pyarrow.parquet as pq

from .table import Table, Text

__all__ = ["FORMATS", "Writer", "make_writer"]

FORMATS = ("table", "jsonl", "csv", "parquet", "ids")
"""Names of the formats."""

_json = json.JSONEncoder(ensure_ascii=False).encode

_COLUMNS: tuple[str, ...] = (
    "frame",
    "recording",
    "timestamp_us",
    "verdict",
    "correspondence",
    "witness",
    "cause",
    "sensors",
)


_INTERVAL_COLUMNS: tuple[str, ...] = (
    "recording",
    "start_us",
    "end_us",
    "first_frame",
    "last_frame",
    "frame_count",
    "verdict",
    "correspondence",
    "witness",
    "cause",
    "open_ended",
)
_TYPES = {
    "timestamp_us": pa.int64(), "start_us": pa.int64(), "end_us": pa.int64(), "frame_count": pa.int64(),
    "open_ended": pa.bool_(),
}  # fmt: skip
"""Types of the columns that are no texts."""


class Writer(Protocol):
    """Writes results one by one."""

    def write(self, record: Mapping[str, Any]) -> None:
        """Write one result as `scenicq.query.execution.results.record` gives it."""
        ...

    def finish(self) -> None:
        """Write what is held back."""
        ...


class _Lines:
    """One line a result: JSON, or the name of a frame, or the recording and start of an interval, that matches."""

    def __init__(self, text: Text, line: Callable[[Mapping[str, Any]], str | None]) -> None:
        self._text, self._line = text, line

    def write(self, record: Mapping[str, Any]) -> None:
        line = self._line(record)
        if line is not None:
            self._text.write(line + "\n")
            self._text.flush()

    def finish(self) -> None:
        self._text.flush()


def _flat(record: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    """A row of plain cells; nested values become JSON text."""
    if "frames" in record:
        record = {**record, **{f"{key}_frame": record["frames"][key] for key in ("first", "last")}}
        record["frame_count"] = record["frames"]["count"]
    cells = {name: record.get(name, {}) for name in names}
    return {name: _json(cell) if isinstance(cell, Mapping) else cell for name, cell in cells.items()}


def _name(record: Mapping[str, Any]) -> str | None:
    if record["verdict"] != "match":
        return None
    return record["frame"] if "frame" in record else f"{record['recording']}@{record['start_us']}"


class _Csv:
    def __init__(self, text: Text, names: tuple[str, ...]) -> None:
        self._text, self._names = text, names
        self._rows = csv.DictWriter(text, names, lineterminator="\n")
        self._rows.writeheader()

    def write(self, record: Mapping[str, Any]) -> None:
        self._rows.writerow(_flat(record, self._names))
        self._text.flush()

    def finish(self) -> None:
        self._text.flush()


class _Parquet:
    def __init__(self, sink: BinaryIO, names: tuple[str, ...]) -> None:
        self._names = names
        self._schema = pa.schema([(name, _TYPES.get(name, pa.string())) for name in names])
        self._file = pq.ParquetWriter(sink, self._schema)
        self._rows: list[dict[str, Any]] = []

    def write(self, record: Mapping[str, Any]) -> None:
        self._rows.append(_flat(record, self._names))
        if len(self._rows) >= 10_000:
            self._spill()

    def _spill(self) -> None:
        self._file.write_table(pa.Table.from_pylist(self._rows, schema=self._schema))
        self._rows.clear()

    def finish(self) -> None:
        self._spill()
        self._file.close()


def make_writer(name: str, sink: BinaryIO, *, over_time: bool = False) -> Writer:
    """The writer of a format.

    Args:
        name: One of `FORMATS`.
        sink: Where to; it stays open.
        over_time: Whether the results are intervals.
    """
    names = _INTERVAL_COLUMNS if over_time else _COLUMNS
    if name == "parquet":
        return _Parquet(sink, names)
    text = Text(sink)
    match name:
        case "table":
            return Table(text, over_time=over_time)
        case "csv":
            return _Csv(text, names)
        case "ids":
            return _Lines(text, _name)
        case _:
            return _Lines(text, _json)
