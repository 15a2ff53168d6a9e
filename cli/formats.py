"""The formats of results: each writer takes results one by one and writes what it can at once."""

from __future__ import annotations

import csv
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, BinaryIO, Protocol, TextIO

from msgspec import UNSET, structs

from scenicq.errors import printable_json
from scenicq.query.execution.csv_cells import SPREADSHEET_MARK, quote_cell
from scenicq.query.execution.recorded_columns import RecordedColumn, cells_of_row
from scenicq.query.execution.records import (
    DENSITY,
    RECORDED,
    FrameRecord,
    IntervalRecord,
    Record,
    SummaryRecord,
    json_text,
)
from scenicq.query.execution.result_summary import ResultSummary
from scenicq.query.execution.result_tables import result_schema, result_table, summary_metadata
from scenicq.store.frame_names import ShortNames

from .report import printable
from .table import Table, TextStream

if TYPE_CHECKING:
    pass

__all__ = ["FORMATS", "SPREADSHEET_HELP", "CsvRows", "Writer", "make_writer"]

FORMATS = ("table", "jsonl", "csv", "spreadsheet", "parquet", "ids")
"""Names of the formats."""

SPREADSHEET_HELP = (
    "spreadsheet is csv that a spreadsheet opens: a cell that it would take for a formula (=, +, -, @) begins with ', "
    "and is read back without it."
)


class Writer(Protocol):
    """Writes results one by one."""

    def write(self, record: Record) -> None:
        """Write one result."""
        ...

    def finish(self, summary: ResultSummary | None = None) -> None:
        """Write what is held back, and what all results say of themselves where the format has a place for it.

        Args:
            summary: What they say.
        """
        ...

    def stop(self) -> None:
        """The query ended early: write what is held back, if the format can."""
        ...


class _Names:
    """Writes a line for each match: the frame's name, or the recording and start of an interval."""

    def __init__(self, text: TextStream) -> None:
        self._text = text

    def write(self, record: Record) -> None:
        if record.verdict == "match":
            self._text.write(printable(record.name).replace("\n", "\\n") + "\n")
            self._text.flush()

    def finish(self, summary: ResultSummary | None = None) -> None:
        self._text.flush()

    def stop(self) -> None:
        pass


class _HeldBack:
    """Writes each result when the next one comes, so that the last line can carry the summary and still be a result."""

    def __init__(self, text: TextStream, write: Callable[[Record | SummaryRecord], None]) -> None:
        self._text, self._write = text, write
        self._last: Record | None = None

    def write(self, record: Record) -> None:
        last, self._last = self._last, record
        if last is not None:
            self._write(last)

    def finish(self, summary: ResultSummary | None = None) -> None:
        last, self._last = self._last, None
        if last is not None:
            self._write(last if summary is None else structs.replace(last, summary=summary))
        elif summary is not None and not summary.complete:
            self._write(SummaryRecord(summary))
        self._text.flush()

    def stop(self) -> None:
        self.finish()


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
        """Write a row: texts as `csv_cells` makes them, other values unchanged."""
        self._rows.writerow({name: quote_cell(value, spreadsheet=self._spreadsheet) for name, value in row.items()})


class _JsonLines:
    """A line of JSON a result."""

    def __init__(self, text: TextStream) -> None:
        self._text = text

    def write(self, record: Record | SummaryRecord) -> None:
        self._text.write(printable_json(json_text(record)) + "\n")
        self._text.flush()


class _Csv:
    """A row a result, with a column a field; nested values and truth values are JSON."""

    def __init__(
        self, text: TextStream, names: tuple[str, ...], recorded: Sequence[RecordedColumn], *, spreadsheet: bool
    ) -> None:
        self._text, self._names, self._recorded = text, names, recorded
        own = {"recorded": tuple(cell for each in recorded for cell in each.cells)}
        self._rows = CsvRows(text, [cell for name in names for cell in own.get(name, (name,))], spreadsheet=spreadsheet)

    def write(self, record: Record | SummaryRecord) -> None:
        cells = {name: getattr(record, name, UNSET) for name in self._names}
        recorded: dict[str, str | None] = {}
        if not isinstance(record, SummaryRecord):
            cells["cause"] = cells["cause"] or {}
            recorded = cells_of_row(record, self._recorded)
        cells.pop("recorded", None)
        self._rows.write(
            {
                name: None
                if cell is UNSET
                else cell
                if isinstance(cell, str | float | None) or type(cell) is int
                else printable_json(json_text(cell))
                for name, cell in cells.items()
            }
            | {name: None if cell is None else printable_json(cell) for name, cell in recorded.items()}
        )
        self._text.flush()


class _Parquet:
    def __init__(self, sink: BinaryIO, schema: Any) -> None:
        import pyarrow.parquet as pq  # noqa: PLC0415 - takes long to load

        self._schema = schema
        self._file = pq.ParquetWriter(sink, self._schema)
        self._rows: list[Record] = []

    def write(self, record: Record) -> None:
        self._rows.append(record)
        if len(self._rows) >= 10_000:
            self._spill()

    def _spill(self) -> None:
        self._file.write_table(result_table(self._rows, self._schema))
        self._rows.clear()

    def finish(self, summary: ResultSummary | None = None) -> None:
        self._spill()
        if summary is not None:
            self._file.add_key_value_metadata(summary_metadata(summary))
        self._file.close()

    def stop(self) -> None:
        pass


def make_writer(
    name: str,
    sink: BinaryIO,
    roles: Callable[[], Sequence[str]],
    shorten: Callable[[], ShortNames] | None = None,
    recorded: Callable[[], Sequence[RecordedColumn]] = tuple,
    *,
    origin: str = "",
    ranked: bool = False,
    over_time: bool = False,
    every: bool = False,
    timelines: Callable[[], bool] = bool,
) -> Writer:
    """Make the writer of a format.

    Args:
        name: One of `FORMATS`.
        sink: Where to; it stays open.
        roles: Gives the roles that results may name; asked where they are columns.
        shorten: Makes the functions that cut names; called where a table would not fit the terminal.
        recorded: Gives what the program records; asked where that is columns.
        origin: The dataset that the results come from; "" where it is not known.
        ranked: Whether results have a density.
        over_time: Whether the results are intervals.
        every: Whether each correspondence by which a frame matches is a result.
        timelines: Gives whether results say what roles do from when to when; asked where that is a column.
    """
    if name == "parquet":
        schema = result_schema(
            roles(), origin=origin, ranked=ranked, over_time=over_time, every=every, recorded=recorded(),
            timelines=timelines(),
        )  # fmt: skip
        return _Parquet(sink, schema)
    text = TextStream(sink)
    match name:
        case "table":
            return Table(text, shorten, over_time=over_time)
        case "csv" | "spreadsheet":
            columns = recorded()
            absent = {
                "timeline": timelines(),
                "all_matches": every,
                "dataset": bool(origin),
                **dict.fromkeys(DENSITY, ranked),
            }
            absent |= dict.fromkeys(RECORDED, bool(columns))
            left_out = {name for name, there in absent.items() if not there}
            kind = IntervalRecord if over_time else FrameRecord
            names = tuple(name for name in kind.__struct_fields__ if name not in left_out)
            return _HeldBack(text, _Csv(text, names, columns, spreadsheet=name == "spreadsheet").write)
        case "ids":
            return _Names(text)
        case _:
            return _HeldBack(text, _JsonLines(text).write)
