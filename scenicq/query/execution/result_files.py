"""The files that `scenicq match -o` writes, read back: JSON lines, CSV or Parquet, by the extension."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import msgspec
import pyarrow as pa
import pyarrow.parquet as pq
from msgspec import UNSET, structs

from scenicq.errors import DataError, Diagnostic
from scenicq.query.execution.csv_cells import unquote_cell
from scenicq.query.execution.recorded_columns import is_cell, read_cells
from scenicq.query.execution.records import DENSITY, Record, SummaryRecord, decode_record, record_of
from scenicq.query.execution.result_summary import Completeness, ResultSummary, join_summaries, refuse_newer
from scenicq.query.execution.result_tables import METADATA, read_row, read_summary, stated_summary
from scenicq.store.remote_path import AnyPath
from scenicq.store.unpacked import RECORD_BYTES, Bound, check_claims, decoded_bytes, text_columns

__all__ = ["ReadResults", "RecordStream", "read_records", "read_results"]

_T = TypeVar("_T")

_NEEDED = ("frame", "recording", "verdict", "timestamp_us", "correspondence", "cause",
           "start_us", "end_us", "frames")  # fmt: skip
"""What tells what became of a result."""
_NESTED = ("correspondence", "cause", "sensors", "witness", "lanes", "frames", "timeline", "unrecorded", "summary")
_SUMMARY = '"summary"'
_LONGEST = 10_000_000
"""Characters of a cell of CSV."""


@dataclass(frozen=True, slots=True)
class ReadResults:
    """The results in a file.

    Attributes:
        records: By frame, or by recording and start.
        completeness: What it means that a frame is not among them.
    """

    records: Mapping[str, Record]
    completeness: Completeness


def read_results(path: AnyPath) -> ReadResults:
    """The results in a file by name; of several of one frame the first match counts.

    Raises:
        DataError: file-missing, file-invalid, or results-version.
    """
    found: dict[str, Record] = {}
    records = RecordStream(_records(path, _NEEDED))
    for each in records:
        old = found.get(each.name)
        if old is None or (each.verdict == "match" and old.verdict != "match"):
            found[each.name] = each
    return ReadResults(found, records.completeness)


def read_records(path: AnyPath) -> RecordStream:
    """All results in a file with all that they say: of frames, or of intervals of recordings.

    Raises:
        DataError: file-missing, file-invalid, or results-version; as the results are taken.
    """
    return RecordStream(_records(path, None))


@dataclass(slots=True)
class RecordStream:
    """Results to be gone through once, without what they say of themselves; that is there when all are taken.

    Attributes:
        records: The results.
    """

    records: Iterable[Record | SummaryRecord]
    _held: int = field(default=0, init=False)
    _summaries: list[ResultSummary] = field(default_factory=list[ResultSummary], init=False)

    @property
    def completeness(self) -> Completeness:
        """What it means that a frame is not among the results."""
        return Completeness(join_summaries(self._summaries), self._held)

    def __iter__(self) -> Iterator[Record]:
        """The results."""
        for each in self.records:
            if each.summary is not UNSET:
                self._summaries.append(each.summary)
            if not isinstance(each, SummaryRecord):
                self._held += 1
                yield each if each.summary is UNSET else structs.replace(each, summary=UNSET)


def _records(path: AnyPath, columns: tuple[str, ...] | None) -> Iterator[Record | SummaryRecord]:
    """What a file holds.

    Args:
        path: The file.
        columns: What is read of Parquet, as far as it is there; None for all.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{path} cannot be read: {error.strerror or error}")) from None
    match path.suffix.lower():
        case ".parquet":
            return _of_parquet(path, data, columns)
        case ".csv":
            return _of_csv(path, _text(path, data))
        case _:
            return _of_lines(path, _text(path, data))


def _invalid(path: AnyPath, why: str) -> DataError:
    hint = "`scenicq match ... -o FILE` writes such a file: .jsonl, .csv or .parquet"
    return DataError(Diagnostic("file-invalid", f"{path} holds no results: {why}", hints=(hint,)))


def _text(path: AnyPath, data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise _invalid(path, "it is not text in UTF-8") from None


def _read(path: AnyPath, where: str, read: Callable[[], _T]) -> _T:
    try:
        return read()
    except (msgspec.DecodeError, RecursionError) as error:
        raise _invalid(path, f"{where} is no result: {error}") from None


def _of_lines(path: AnyPath, text: str) -> Iterator[Record | SummaryRecord]:
    lines = text.split("\n")
    refuse_newer(str(path), next(filter(str.strip, reversed(lines)), ""))
    for number, line in enumerate(lines, 1):
        if line.strip():
            # files may have been put together
            if _SUMMARY in line:
                refuse_newer(str(path), line)
            yield _read(path, f"line {number}", lambda line=line: decode_record(line))


def _of_csv(path: AnyPath, text: str) -> Iterator[Record | SummaryRecord]:
    limit = csv.field_size_limit(_LONGEST)
    try:
        for summary in _summaries(text):
            refuse_newer(str(path), f'{{"summary": {summary}}}')
        rows = csv.DictReader(io.StringIO(text, newline=""), strict=True)
        for number, row in enumerate(rows, 1):
            yield _read(path, f"row {number}", lambda row=row: record_of(_values(row)))
    except csv.Error as error:
        raise _invalid(path, f"it is not CSV: {error}") from None
    finally:
        csv.field_size_limit(limit)


def _summaries(text: str) -> Iterator[str]:
    """The summaries in a file of CSV: one, unless files have been put together."""
    rows = csv.reader(io.StringIO(text, newline=""), strict=True)
    header = next(rows, list[str]())
    if "summary" in header:
        place = header.index("summary")
        yield from (row[place] for row in rows if len(row) > place and row[place])


def _values(row: Mapping[str, Any]) -> dict[str, Any]:
    """The values of cells, of which some hold JSON; an empty one says nothing."""
    found: dict[str, Any] = read_cells({name: cell for name, cell in row.items() if isinstance(cell, str)})
    for name, cell in row.items():
        # a row that is too long or too short has cells that are no texts
        text = unquote_cell(cell) if isinstance(cell, str) else cell
        if is_cell(name):
            continue
        if text == "":
            found |= {name: None} if name in DENSITY else {}
        else:
            found[name] = msgspec.json.decode(text) if name in _NESTED and isinstance(text, str) else text
    if found.get("cause") == {}:
        del found["cause"]
    return {"summary": found["summary"]} if not found.get("verdict") and "summary" in found else found


def _of_parquet(path: AnyPath, data: bytes, columns: tuple[str, ...] | None) -> Iterator[Record | SummaryRecord]:
    try:
        bound = Bound(str(path), len(data))
        with pq.ParquetFile(pa.BufferReader(data)) as parquet:
            chosen = None if columns is None else [name for name in columns if name in parquet.schema_arrow.names]
            check_claims(parquet, bound, chosen)
            bound.check(RECORD_BYTES * parquet.metadata.num_rows)
            texts = text_columns(parquet)
            metadata = parquet.metadata.metadata
        refuse_newer(str(path), stated_summary(metadata))
        table = pq.read_table(pa.BufferReader(data), columns=chosen, read_dictionary=texts)
        for chunk in (chunk for column in table.columns for chunk in column.chunks):
            bound.add(decoded_bytes(chunk))
    except (pa.ArrowException, OSError) as error:
        raise _invalid(path, f"it is not Parquet with results: {str(error).partition(chr(10))[0]}") from None
    origin = (table.schema.metadata or {}).get(METADATA, b"").decode(errors="replace")
    rows: list[dict[str, Any]] = table.to_pylist()
    for number, row in enumerate(rows, 1):
        yield _read(path, f"row {number}", lambda row=row: read_row(row, origin))
    if (summary := _read(path, "its summary", lambda: read_summary(metadata))) is not None:
        yield SummaryRecord(summary)
