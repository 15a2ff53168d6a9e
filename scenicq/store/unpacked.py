"""How much a packed file may unpack to, counted before it does: gzip, and columns of Parquet and Feather files.

A text that a dictionary holds once may stand in a million rows, and a buffer of zeros packs to nothing; so what a file
takes on disk says little of what it takes in memory.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.types as kinds

from scenicq.errors import DataError, Diagnostic

if TYPE_CHECKING:  # not every file is Parquet
    import pyarrow.parquet as pq

__all__ = ["RECORD_BYTES", "Bound", "check_claims", "decoded_bytes", "feather_batches", "text_columns"]

_LEAST, _MOST_TIMES = 1 << 28, 200
"""Bytes that a packed file may always unpack to, and how many times its size beyond; labels pack to a tenth."""
_VALUE_BYTES = 32
"""Bytes of a value once it is an object of Python, beside the characters of a text."""
RECORD_BYTES = 1600
"""Bytes of what is made of a row, or of an object of a label, beside its values: 1,800 in all were measured."""
_MAGIC = b"ARROW1\0\0"
_DICTIONARY_BATCH, _RECORD_BATCH = 2, 3


class Bound:
    """A limit on what a file unpacks to: it counts bytes, and refuses the file beyond the limit."""

    def __init__(self, file: str | Path, size: int | None = None) -> None:
        """Begin to count.

        Args:
            file: The file.
            size: In bytes; looked up by default.

        Raises:
            OSError: The file is not there.
        """
        self._file = file
        self._most = max(_LEAST, _MOST_TIMES * (Path(file).stat().st_size if size is None else size))
        self._bytes = 0

    def add(self, size: int) -> None:
        """Count bytes.

        Raises:
            DataError: file-invalid: there are too many.
        """
        self.check(size)
        self._bytes += size

    def check(self, size: int) -> None:
        """Refuse the file if so many bytes more would be too many.

        Raises:
            DataError: file-invalid.
        """
        if self._bytes + size > self._most:
            message = f"{self._file} unpacks to more than {self._most:,} bytes, {_MOST_TIMES} times its size"
            raise DataError(Diagnostic("file-invalid", message))


def text_columns(parquet: pq.ParquetFile) -> list[str]:
    """The columns of a Parquet file, nested ones too, that are to be read as dictionaries: texts are there once.

    Args:
        parquet: A `pyarrow.parquet.ParquetFile`.
    """
    leaves = (parquet.schema.column(number) for number in range(len(parquet.schema)))
    return [leaf.path for leaf in leaves if leaf.physical_type == "BYTE_ARRAY"]


def check_claims(parquet: pq.ParquetFile, bound: Bound, columns: Sequence[str] | None = None) -> None:
    """Refuse a Parquet file whose own metadata say that its columns are too large.

    Args:
        parquet: A `pyarrow.parquet.ParquetFile`.
        bound: The file's bound; what the file claims is not counted.
        columns: Those that are read; all by default.

    Raises:
        DataError: file-invalid.
    """
    claimed = 0
    meta = parquet.metadata
    for group in map(meta.row_group, range(meta.num_row_groups)):
        for chunk in map(group.column, range(group.num_columns)):
            if columns is None or chunk.path_in_schema.partition(".")[0] in columns:
                claimed += max(chunk.total_uncompressed_size, _VALUE_BYTES * chunk.num_values)
    bound.check(claimed)


def decoded_bytes(array: pa.Array, record: int = 0) -> int:
    """Estimate, without decoding it, how many bytes an array takes as objects of Python.

    Args:
        array: A `pyarrow.Array`.
        record: Bytes of each struct, beside its members.
    """
    total, stack = 0, [array]
    while stack:
        each = stack.pop()
        total += _VALUE_BYTES * len(each)
        kind = each.type
        if isinstance(each, pa.ExtensionArray):
            stack.append(each.storage)
        elif kinds.is_dictionary(kind):
            sizes = np.array([*map(len, _texts(each.dictionary)), 0])
            total += int(sizes[pc.fill_null(each.indices, len(sizes) - 1).to_numpy(zero_copy_only=False)].sum())
        elif kinds.is_struct(kind):
            total += record * len(each)
            stack += each.flatten()
        elif kinds.is_map(kind):
            # of an empty map within another there is one
            offsets = each.offsets.to_pylist()
            first, end = offsets[0], offsets[-1]
            stack += [each.keys.slice(first, end - first), each.items.slice(first, end - first)]
        elif kinds.is_list(kind) or kinds.is_large_list(kind) or kinds.is_fixed_size_list(kind):
            stack.append(each.flatten())
        elif str(kind) in ("string_view", "binary_view"):
            views = np.frombuffer(each.buffers()[1] or b"", np.int32).reshape(-1, 4)
            total += int(views[each.offset : each.offset + len(each), 0].astype(np.int64).sum())
        elif str(kind).startswith(("run_end_encoded", "list_view", "large_list_view")):
            raise pa.ArrowNotImplementedError(f"columns of type {kind} are not read")
        else:
            total += each.nbytes
    return total


def _texts(values: pa.Array) -> Sequence[bytes]:
    """The values of a dictionary, of which only texts have a length."""
    kind = values.type
    if kinds.is_string(kind) or kinds.is_large_string(kind) or kinds.is_binary(kind) or kinds.is_large_binary(kind):
        return [b"" if each is None else each for each in values.cast(pa.large_binary()).to_pylist()]
    if kinds.is_nested(kind):
        raise pa.ArrowNotImplementedError(f"dictionaries of {kind} are not read")
    return [b""] * len(values)


def feather_batches(data: bytes, bound: Bound) -> tuple[pa.Schema, list[pa.RecordBatch]]:
    """The schema and the record batches of a Feather file; what its buffers unpack to is counted before they do.

    Args:
        data: The file.
        bound: The file's bound.

    Raises:
        DataError: file-invalid: it unpacks to too much.
        ValueError: It is no Feather file; Arrow has errors of its own for that, too.
    """
    with pa.ipc.open_file(pa.BufferReader(data)) as file:
        count = file.num_record_batches
    # a file is a stream with a footer that says where what is in it; the stream is what is counted, and then read
    stream = pa.py_buffer(data).slice(len(_MAGIC))
    messages = pa.ipc.MessageReader.open_stream(pa.BufferReader(stream))
    while True:
        try:
            message = messages.read_next_message()
        except StopIteration:
            break
        for size in _unpacked_sizes(memoryview(message.metadata), memoryview(message.body or b"")):
            bound.add(size)
    with pa.ipc.open_stream(pa.BufferReader(stream)) as reader:
        batches = list(reader)
        if len(batches) != count:
            raise pa.ArrowInvalid(f"it has {len(batches)} batches, and its footer says {count}")
        return reader.schema, batches


def _unpacked_sizes(metadata: memoryview, body: memoryview) -> Iterator[int]:
    """What each buffer of a message unpacks to, as its first eight bytes say; nothing for one that is not packed."""
    try:
        root = _offset(metadata, 0)
        kind = _field(metadata, root, 1)
        header = _field(metadata, root, 2)
        if kind is None or header is None or metadata[kind] not in (_DICTIONARY_BATCH, _RECORD_BATCH):
            return
        table = _offset(metadata, header)
        if metadata[kind] == _DICTIONARY_BATCH:
            inner = _field(metadata, table, 1)
            if inner is None:
                return
            table = _offset(metadata, inner)
        buffers, compression = _field(metadata, table, 2), _field(metadata, table, 3)
        if buffers is None or compression is None:
            return
        vector = _offset(metadata, buffers)
        (count,) = struct.unpack_from("<I", metadata, vector)
        for start, length in struct.iter_unpack("<qq", metadata[vector + 4 : vector + 4 + 16 * count]):
            if length:
                (size,) = struct.unpack_from("<q", body, start)
                yield max(0, size)
    except (struct.error, IndexError, ValueError) as error:
        raise pa.ArrowInvalid("a message of it is damaged") from error


def _offset(data: memoryview, place: int) -> int:
    """Where an offset of a FlatBuffer leads."""
    (offset,) = struct.unpack_from("<I", data, place)
    return place + offset


def _field(data: memoryview, table: int, number: int) -> int | None:
    """Where a field of a table of a FlatBuffer is; None where it has its default."""
    (back,) = struct.unpack_from("<i", data, table)
    size, _, *_ = struct.unpack_from("<HH", data, table - back)
    if 4 + 2 * number >= size:
        return None
    (offset,) = struct.unpack_from("<H", data, table - back + 4 + 2 * number)
    return table + offset if offset else None
