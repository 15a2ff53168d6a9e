"""The formats of results: each writer takes results one by one and writes what it can at once."""

# pyarrow has no type stubs.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import csv
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, BinaryIO, Protocol, TextIO

from scenicq.errors import plain_json
from scenicq.query.execution.csv_cells import SPREADSHEET_MARK, quote_cell
from scenicq.query.execution.result_lines import json_line, json_text
from scenicq.query.execution.result_origin import ORIGIN
from scenicq.query.execution.result_tables import DENSITY_COLUMNS, result_schema, result_table
from scenicq.query.execution.results import Result, record
from scenicq.store.frame_names import ShortNames

from .report import plain
from .table import Table, TextStream

__all__ = ["FORMATS", "SPREADSHEET_HELP", "CsvRows", "Writer", "make_writer", "result_writer"]

FORMATS = ("table", "jsonl", "csv", "spreadsheet", "parquet", "ids")
"""Names of the formats."""

SPREADSHEET_HELP = (
    "spreadsheet is csv that a spreadsheet opens: a cell that it would take for a formula (=, +, -, @) begins with ', "
    "and is read back without it."
)

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
    "frames",
    "verdict",
    "correspondence",
    "witness",
    "cause",
    "open_ended",
)


class Writer(Protocol):
    """Writes results one by one: records, which name their dataset if it is known."""

    def write(self, record: Mapping[str, Any]) -> None:
        """Write one result as `scenicq.query.execution.results.record` gives it."""
        ...

    def finish(self) -> None:
        """Write what is held back."""
        ...


class _Lines:
    """One line a result: JSON, or the name of a frame, or the recording and start of an interval, that matches."""

    def __init__(self, text: TextStream, line: Callable[[Mapping[str, Any]], str | None]) -> None:
        self._text, self._line = text, line

    def write(self, record: Mapping[str, Any]) -> None:
        line = self._line(record)
        if line is not None:
            self._put(line)

    def _put(self, line: str) -> None:
        self._text.write(line + "\n")
        self._text.flush()

    def finish(self) -> None:
        self._text.flush()


class _JsonLines(_Lines):
    """One line of JSON a result."""

    def __init__(self, text: TextStream) -> None:
        super().__init__(text, lambda record: plain_json(json_text(record)))

    def write_result(self, result: Result, more: Mapping[str, str]) -> None:
        """Write a result of which nobody has the record."""
        self._put(plain_json(json_line(result, more)))


def _flat(record: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    """A row of plain cells; nested values and truth values become JSON text."""
    cells = {name: record.get(name, {}) for name in names}
    return {
        name: plain_json(json_text(cell)) if isinstance(cell, Mapping | bool) else cell for name, cell in cells.items()
    }


def _name(record: Mapping[str, Any]) -> str | None:
    if record["verdict"] != "match":
        return None
    name = record["frame"] if "frame" in record else f"{record['recording']}@{record['start_us']}"
    return plain(name).replace("\n", "\\n")


class CsvRows:
    """Rows of CSV, for programs or for a spreadsheet."""

    def __init__(self, text: TextStream | TextIO, names: Collection[str], *, spreadsheet: bool) -> None:
        """Write the header.

        Args:
            text: Where to.
            names: The names of the columns.
            spreadsheet: Whether a spreadsheet is to read it.
        """
        self._spreadsheet = spreadsheet
        if spreadsheet:
            text.write(SPREADSHEET_MARK)
        self._rows = csv.DictWriter(text, names, lineterminator="\n")
        self._rows.writeheader()

    def write(self, row: Mapping[str, Any]) -> None:
        """Write a row: texts as `csv_cells` has them, all else as it is."""
        self._rows.writerow({name: quote_cell(value, spreadsheet=self._spreadsheet) for name, value in row.items()})


class _Csv:
    def __init__(self, text: TextStream, names: tuple[str, ...], *, spreadsheet: bool) -> None:
        self._text, self._names = text, names
        self._rows = CsvRows(text, names, spreadsheet=spreadsheet)

    def write(self, record: Mapping[str, Any]) -> None:
        row = _flat(record, self._names) | {
            name: record.get(name) for name in (*DENSITY_COLUMNS, ORIGIN) if name in self._names
        }
        self._rows.write(row)
        self._text.flush()

    def finish(self) -> None:
        self._text.flush()


class _Parquet:
    def __init__(self, sink: BinaryIO, roles: Sequence[str], origin: str, *, ranked: bool, over_time: bool) -> None:
        import pyarrow.parquet as pq  # noqa: PLC0415 - takes long to load

        self._schema = result_schema(roles, origin=origin, ranked=ranked, over_time=over_time)
        self._file = pq.ParquetWriter(sink, self._schema)
        self._rows: list[Mapping[str, Any]] = []

    def write(self, record: Mapping[str, Any]) -> None:
        self._rows.append(record)
        if len(self._rows) >= 10_000:
            self._spill()

    def _spill(self) -> None:
        self._file.write_table(result_table(self._rows, self._schema))
        self._rows.clear()

    def finish(self) -> None:
        self._spill()
        self._file.close()


def make_writer(
    name: str,
    sink: BinaryIO,
    roles: Callable[[], Sequence[str]],
    shorten: Callable[[], ShortNames] | None = None,
    *,
    origin: str = "",
    ranked: bool = False,
    over_time: bool = False,
) -> Writer:
    """The writer of a format.

    Args:
        name: One of `FORMATS`.
        sink: Where to; it stays open.
        roles: Gives the roles that results may name; asked where they are columns.
        shorten: Gives what cuts names short; asked where a table would not fit the terminal.
        origin: The dataset that the results come from; "" where it is not known.
        ranked: Whether results have a density.
        over_time: Whether the results are intervals.
    """
    names = _INTERVAL_COLUMNS if over_time else _COLUMNS
    if name == "parquet":
        return _Parquet(sink, roles(), origin, ranked=ranked, over_time=over_time)
    text = TextStream(sink)
    match name:
        case "table":
            return Table(text, shorten, over_time=over_time)
        case "csv" | "spreadsheet":
            more = (*(DENSITY_COLUMNS if ranked else ()), *((ORIGIN,) if origin else ()))
            return _Csv(text, (*names, *more), spreadsheet=name == "spreadsheet")
        case "ids":
            return _Lines(text, _name)
        case _:
            return _JsonLines(text)


def result_writer(writer: Writer, origin: str) -> Callable[[Result], None]:
    """What writes results of a dataset.

    Args:
        writer: The writer of a format.
        origin: The dataset.
    """
    more = {ORIGIN: origin}
    if isinstance(writer, _JsonLines):
        return lambda result: writer.write_result(result, more)
    return lambda result: writer.write(record(result) | more)
