"""Feather and Parquet files that nobody has checked: columns of known types, or `DataError`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.fields import LONGEST_TEXT
from scenicq.store.unpacked import RECORD_BYTES, Bound, check_claims, decoded_bytes, feather_batches, text_columns

__all__ = ["read_feather", "read_parquet"]

Count = Callable[[Sequence[str], int], object]
"""Takes the names of all columns of a table, and how many rows it has."""

_TEXTS = ("string", "large_string", "string_view")
_TYPES: dict[str, Any] = {"integer": pa.int64(), "real": pa.float64(), "text": pa.string()}


def read_feather(
    path: Path, columns: Mapping[str, str], optional: Mapping[str, str] | None = None, *, count: Count
) -> dict[str, Any]:
    """Columns of a feather file as lists.

    Args:
        path: The file.
        columns: "integer", "real" or "text" for each column that it must have.
        optional: The same for columns that it may have.
        count: Counts what is not read.

    Raises:
        DataError: `file-missing`, or `file-invalid` where it is none, is cut off or has other columns.
    """
    with _told(path, "a feather file"):
        bound = Bound(path)
        schema, batches = feather_batches(path.read_bytes(), bound)
        table = pa.Table.from_batches(batches, schema)
        bound.check(RECORD_BYTES * len(table))
        found = _columns(path, table, columns, optional or {}, bound)
        count(table.schema.names, table.num_rows)
        return found


def read_parquet(
    path: Path, columns: Mapping[str, str], optional: Mapping[str, str] | None = None, *, count: Count
) -> dict[str, Any]:
    """Columns of a Parquet file as lists; see `read_feather`.

    Raises:
        DataError: `file-missing` or `file-invalid`.
    """
    with _told(path, "a Parquet file"), pq.ParquetFile(path) as file:
        bound = Bound(path)
        there = [name for name in {**columns, **(optional or {})} if name in file.schema_arrow.names]
        check_claims(file, bound, there)
        bound.check(RECORD_BYTES * file.metadata.num_rows)
        texts = [name for name in text_columns(file) if name in there]
    with _told(path, "a Parquet file"), pq.ParquetFile(path, read_dictionary=texts) as file:
        found = _columns(path, file.read(columns=there), columns, optional or {}, bound)
        count(file.schema_arrow.names, file.metadata.num_rows)
        return found


class _told:  # noqa: N801 - reads as a statement
    """Turns what pyarrow raises into a diagnostic."""

    def __init__(self, path: Path, what: str) -> None:
        self._path = path
        self._what = what

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        if isinstance(error, pa.ArrowException | MemoryError | ValueError | OverflowError):
            message = f"{self._path} is not {self._what}: {_first_line(error)}"
            raise DataError(Diagnostic("file-invalid", message)) from error
        if isinstance(error, OSError):
            # pyarrow's own error for files that are cut off is an OSError without a number.
            missing = error.errno is not None
            message = f"{self._path} cannot be read: {error.strerror or _first_line(error)}"
            raise DataError(Diagnostic("file-missing" if missing else "file-invalid", message)) from error


def _first_line(error: object) -> str:
    return (str(error).splitlines() or ["unreadable"])[0][:200]


def _columns(
    path: Path, table: Any, wanted: Mapping[str, str], optional: Mapping[str, str], bound: Bound
) -> dict[str, Any]:
    twice = [name for name in (*wanted, *optional) if table.schema.names.count(name) > 1]
    if twice:
        raise DataError(Diagnostic("file-invalid", f"{path} has the column `{twice[0]}` more than once"))
    missing = [name for name in wanted if name not in table.schema.names]
    if missing:
        listed = ", ".join(f"`{name}`" for name in missing)
        raise DataError(Diagnostic("file-invalid", f"{path} lacks the columns {listed}"))
    table.validate(full=True)
    found: dict[str, Any] = {}
    for name, kind in {**wanted, **optional}.items():
        if name in table.schema.names:
            column = table[name]
            for chunk in column.chunks:
                bound.add(decoded_bytes(chunk))
            if pa.types.is_dictionary(column.type):
                column = column.cast(column.type.value_type)
            if pa.types.is_timestamp(column.type) and name.endswith("_ns"):
                column = column.cast(pa.timestamp("ns", column.type.tz)).cast(pa.int64())
            if _kind(column.type) not in ({"integer"} if kind == "integer" else {kind, "integer"}):
                message = f"{path}: column `{name}` is of type {column.type}, not {kind}"
                raise DataError(Diagnostic("file-invalid", message))
            column = column.cast(_TYPES[kind])
            if kind == "text" and (pc.max(pc.utf8_length(column)).as_py() or 0) > LONGEST_TEXT:
                message = f"{path}: column `{name}` has a text of more than {LONGEST_TEXT} characters"
                raise DataError(Diagnostic("file-invalid", message))
            found[name] = column.to_pylist()
    return found


def _kind(type_: Any) -> str:
    if pa.types.is_integer(type_):
        return "integer"
    if pa.types.is_floating(type_):
        return "real"
    return "text" if str(type_) in _TEXTS else str(type_)
