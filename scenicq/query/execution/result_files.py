"""The files that `scenicq match -o` writes, read back: JSON lines, CSV or Parquet, by the extension."""

# pyarrow has no type stubs.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

import pyarrow as pa
import pyarrow.parquet as pq

from scenicq.errors import DataError, Diagnostic
from scenicq.query.execution.csv_cells import unquote_cell
from scenicq.query.execution.result_origin import METADATA, ORIGIN
from scenicq.query.execution.result_tables import read_row
from scenicq.store.unpacked import RECORD_BYTES, Bound, check_claims, decoded_bytes, text_columns

__all__ = ["Record", "read_records", "read_results"]

Record = Mapping[str, Any]
"""One result: frame, recording, verdict, what else `scenicq.query.execution.results.record` gives, and the dataset."""

_TEXTS = ("frame", "recording", "verdict")
_NEEDED = (*_TEXTS, "timestamp_us", "correspondence", "cause")
_NESTED = ("correspondence", "cause", "sensors", "witness", "frames")
_TIMES = ("timestamp_us", "start_us", "end_us")
_LONGEST = 10_000_000
"""Characters of a cell of CSV."""


def read_results(path: Path) -> dict[str, Record]:
    """The results in a file by frame; of several of one frame the first match counts.

    Raises:
        DataError: file-missing, or file-invalid.
    """
    found: dict[str, Record] = {}
    for where, each in _records(path, _NEEDED):
        _check(path, where, each, _TEXTS)
        old = found.get(each["frame"])
        if old is None or (each["verdict"] == "match" and old["verdict"] != "match"):
            found[each["frame"]] = each
    return found


def read_records(path: Path) -> Iterator[Record]:
    """All results in a file with all that they say: of frames, or of intervals of recordings.

    Raises:
        DataError: file-missing, or file-invalid.
    """
    for where, each in _records(path, None):
        _check(path, where, each, ("verdict",))
        _check(path, where, each, ("frame",) if "frame" in each else ("recording",))
        yield each


def _records(path: Path, columns: tuple[str, ...] | None) -> Iterator[tuple[str, Record]]:
    """The results, each with the line or row where it is."""
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


def _invalid(path: Path, why: str) -> DataError:
    hint = "`scenicq match ... -o FILE` writes such a file: .jsonl, .csv or .parquet"
    return DataError(Diagnostic("file-invalid", f"{path} holds no results: {why}", hints=(hint,)))


def _text(path: Path, data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise _invalid(path, "it is not text in UTF-8") from None


def _json(path: Path, where: str, text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        raise _invalid(path, f"{where} is not JSON") from None


def _check(path: Path, where: str, each: Any, texts: tuple[str, ...]) -> None:
    if not isinstance(each, dict) or not all(isinstance(cast(Record, each).get(key), str) for key in texts):
        raise _invalid(path, f"{where} is no result")


def _of_lines(path: Path, text: str) -> Iterator[tuple[str, Any]]:
    for number, line in enumerate(text.split("\n"), 1):
        if line.strip():
            where = f"line {number}"
            yield where, _json(path, where, line)


def _of_csv(path: Path, text: str) -> Iterator[tuple[str, Record]]:
    limit = csv.field_size_limit(_LONGEST)
    try:
        rows = csv.DictReader(io.StringIO(text, newline=""), strict=True)
        for number, row in enumerate(rows, 1):
            # a row that is too long or too short has cells that are no texts
            cells = {name: unquote_cell(cell) if isinstance(cell, str) else cell for name, cell in row.items()}
            yield f"row {number}", _row(path, f"row {number}", cells)
    except csv.Error as error:
        raise _invalid(path, f"it is not CSV: {error}") from None
    finally:
        csv.field_size_limit(limit)


def _of_parquet(path: Path, data: bytes, columns: tuple[str, ...] | None) -> Iterator[tuple[str, Record]]:
    try:
        bound = Bound(path, len(data))
        with pq.ParquetFile(pa.BufferReader(data)) as parquet:
            check_claims(parquet, bound, columns)
            bound.check(RECORD_BYTES * parquet.metadata.num_rows)
            texts = text_columns(parquet)
        chosen = None if columns is None else list(columns)
        table = pq.read_table(pa.BufferReader(data), columns=chosen, read_dictionary=texts)
        for chunk in (chunk for column in table.columns for chunk in column.chunks):
            bound.add(decoded_bytes(chunk))
    except (pa.ArrowException, OSError) as error:
        raise _invalid(path, f"it is not Parquet with results: {str(error).partition(chr(10))[0]}") from None
    origin = (table.schema.metadata or {}).get(METADATA, b"").decode(errors="replace")
    named = {ORIGIN: origin} if origin else {}
    for number, row in enumerate(table.to_pylist(), 1):
        yield f"row {number}", _row(path, f"row {number}", read_row(row) | named)


def _row(path: Path, where: str, row: Record) -> Record:
    """A row of plain cells, of which some hold JSON."""
    found = dict(row)
    for name in _NESTED:
        if isinstance(found.get(name), str):
            found[name] = _json(path, f"{name} in {where}", found[name])
    for name in _TIMES:
        time = found.get(name)
        if isinstance(time, str) and time.removeprefix("-").isdecimal() and len(time) < 20:
            found[name] = int(time)
    return found
