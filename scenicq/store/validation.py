"""Check that the tables of a dataset hold what every reader of them takes for granted.

Checksums say that files are as they were written, not that who wrote them meant well. Here each table is looked at by
itself: columns, types, numbers, texts, JSON. `rules` compares tables with each other, `map_validation` looks at
maps. What the writer guarantees needs no such look.
"""

from __future__ import annotations

from collections.abc import Collection, Generator, Sequence
from contextlib import contextmanager
from typing import NoReturn

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pyarrow.types as kinds

from scenicq.errors import DataError, Diagnostic
from scenicq.store.classes import is_class
from scenicq.store.place import StoreFile, open_parquet
from scenicq.store.schema import SCHEMAS, ArrowArray, ArrowTable
from scenicq.store.value_rules import TEXT_KEYS, is_json, longest_text, plain_object_problem, unsound_reals

__all__ = ["check_columns", "check_table", "decoding", "invalid", "read_sound"]

_MOST_BYTES = 1 << 32
"""Bytes of one file, decoded. A segment has a quarter of that at most, unless a recording is very long."""
_NOT_NEGATIVE = frozenset({"object_count", "first_object", "sensor_count", "first_sensor", "ordinal"})


def invalid(file: object, what: str, row: int | None = None, column: str | None = None) -> NoReturn:
    """Refuse a dataset.

    Args:
        file: The file that is not sound, as it is called in the dataset.
        what: What is wrong with it there.
        row: Counted from 0.
        column: Its name.

    Raises:
        DataError: dataset-invalid.
    """
    places = [f"row {row + 1}"] if row is not None else []
    places += [f"column `{column}`"] if column is not None else []
    where = ", ".join([str(file), *places])
    hint = "whoever made the dataset must make it again: `scenicq ingest` writes none like this"
    raise DataError(Diagnostic("dataset-invalid", f"{where}: {what}", hints=(hint,)))


def read_sound(table: str, file: StoreFile, name: str, columns: Sequence[str] | None = None) -> ArrowTable:
    """All rows of a file, every column of which is sound by itself.

    Args:
        table: A key of `SCHEMAS`.
        file: The file.
        name: What it is called in the dataset.
        columns: What is read, and must be there; all that the table has, and nothing else, by default.

    Raises:
        DataError: dataset-invalid.
    """
    fields = [field for field in SCHEMAS[table] if columns is None or field.name in columns]
    with decoding(name):
        with open_parquet(file) as parquet:
            found = parquet.schema_arrow.names
            check_columns(parquet, fields, found if columns is None else [n for n in found if n in columns], name)
            rows = parquet.read(columns)
        rows.validate(full=True)
    for field in fields:
        _check_column(field, rows[field.name].combine_chunks(), name)
    return rows


def check_table(table: str, file: StoreFile, name: str, kept: Collection[str]) -> ArrowTable:
    """Check every column of a file by itself, one at a time, so that memory is that of what is kept.

    Args:
        table: A key of `SCHEMAS`.
        file: The file.
        name: What it is called in the dataset.
        kept: Columns to give back.

    Returns:
        Those columns; texts as dictionaries, in which each is there once.

    Raises:
        DataError: dataset-invalid.
    """
    fields = list(SCHEMAS[table])
    columns: dict[str, ArrowArray] = {}
    with decoding(name), open_parquet(file) as parquet:
        check_columns(parquet, fields, parquet.schema_arrow.names, name)
        said = parquet.metadata
    texts = [field.name for field in fields if field.type == pa.string()]
    with decoding(name), open_parquet(file, metadata=said, read_dictionary=texts) as parquet:
        for field in fields:
            column = parquet.read([field.name]).column(0)
            column.validate(full=True)
            values = column.unify_dictionaries().combine_chunks()
            _check_column(field, values, name)
            if field.name in kept:
                columns[field.name] = values
    return pa.table(columns)


@contextmanager
def decoding(name: str) -> Generator[None]:
    """Refuse the file if a library cannot decode it in the block.

    Args:
        name: What it is called in the dataset.

    Raises:
        DataError: dataset-invalid.
    """
    try:
        yield
    except (pa.ArrowException, OSError, ValueError, OverflowError, KeyError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise
        invalid(name, f"cannot be decoded: {' '.join(str(error).split())[:200]}")


def check_columns(parquet: pq.ParquetFile, fields: Sequence[pa.Field], names: Sequence[str], name: str) -> None:
    """Check the metadata of a file, before anything is decoded.

    Args:
        parquet: A `pyarrow.parquet.ParquetFile`.
        fields: Those that it must have.
        names: The columns that it has.
        name: What it is called in the dataset.

    Raises:
        DataError: dataset-invalid.
    """
    expected, found = [field.name for field in fields], parquet.schema_arrow
    if names != expected:
        odd = sorted({*names} ^ {*expected})
        told = f": {', '.join(odd[:5])}" if odd else ", or in another order, or twice"
        invalid(name, f"has other columns than it must have{told}"[:300])
    for field in fields:
        if found.field(field.name).type != field.type:
            invalid(name, f"is {found.field(field.name).type}, not {field.type}", column=field.name)
    meta = parquet.metadata
    size = sum(meta.row_group(number).total_byte_size for number in range(meta.num_row_groups))
    if not 0 <= size <= _MOST_BYTES or not 0 <= meta.num_rows <= _MOST_BYTES // 8:
        invalid(name, "would take more than 4 GiB when decoded")


def _check_column(field: pa.Field, values: ArrowArray, file: str) -> None:
    name = field.name
    if values.null_count and not field.nullable:
        invalid(file, "there is no value", _first(pc.is_null(values)), name)
    if kinds.is_list(field.type) or kinds.is_map(field.type):
        _check_nested(name, field.type, values, file)
    elif field.type == pa.float64():
        _check_reals(name, values, file)
    elif field.type == pa.string():
        _check_texts(name, values, file)
    elif kinds.is_integer(field.type) and name in _NOT_NEGATIVE:
        _refuse(pc.less(values, 0), "is negative", file, name)


def _check_nested(name: str, kind: pa.DataType, values: ArrowArray, file: str) -> None:
    """What lists and maps hold; of these the row is that among all items."""
    parts = [values.flatten()] if kinds.is_list(kind) else [values.keys, values.items]
    for items in parts:
        if items.null_count:
            invalid(file, "an item has no value", column=name)
        if items.type == pa.float64():
            _check_reals(name, items, file)
        elif items.type == pa.string():
            _check_texts(name, items, file)
        else:
            _refuse(pc.less(items, 0), "is negative", file, name)


def _check_reals(name: str, values: ArrowArray, file: str) -> None:
    _refuse(pc.invert(pc.is_finite(values)), "is not finite", file, name)
    for wrong, what in unsound_reals(name, values.to_numpy(zero_copy_only=False)):
        if wrong.any():
            invalid(file, what, int(np.argmax(wrong)), name)


def _check_texts(name: str, values: ArrowArray, file: str) -> None:
    coded = values if kinds.is_dictionary(values.type) else values.dictionary_encode()
    texts, numbers = coded.dictionary, coded.indices
    most = longest_text(name)
    if name != "properties":  # of which a map may have long ones
        _refuse_texts(pc.greater(pc.utf8_length(texts), most), f"is longer than {most} characters", numbers, file, name)
    if name in TEXT_KEYS:
        _refuse_texts(pc.equal(texts, ""), "is empty", numbers, file, name)
    if name in ("class", "ego_class"):
        bad = [not (is_class(text) or (text == "" and name == "ego_class")) for text in texts.to_pylist()]
        _refuse_texts(bad, "is no class of the class tree", numbers, file, name)
    if is_json(name) and name != "properties":
        problems = [None if text is None else plain_object_problem(text) for text in texts.to_pylist()]
        for problem in dict.fromkeys(each for each in problems if each is not None):
            _refuse_texts([each == problem for each in problems], problem, numbers, file, name)


def _refuse_texts(bad: Sequence[bool] | ArrowArray, what: str, numbers: ArrowArray, file: str, column: str) -> None:
    """Refuse the first row whose text, by its number, is bad; texts that no row has do no harm."""
    wrong = np.flatnonzero(np.asarray(bad, dtype=bool))
    if len(wrong):
        rows = np.isin(pc.fill_null(numbers, -1).to_numpy(zero_copy_only=False), wrong)
        if rows.any():
            invalid(file, what, int(np.argmax(rows)), column)


def _refuse(bad: ArrowArray, what: str, file: str, column: str) -> None:
    """Refuse the first row where something is true."""
    if pc.any(bad).as_py():
        invalid(file, what, _first(bad), column)


def _first(bad: ArrowArray) -> int:
    return int(np.argmax(pc.fill_null(bad, False).to_numpy(zero_copy_only=False)))
