"""Writing one Parquet file of a table: bounded memory, temporary name, checksum."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from scenicq.store.manifest import Part
from scenicq.store.schema import GEO_METADATA, SCHEMA_VERSION, SCHEMAS, ArrowTable
from scenicq.store.targets import sync_folder

__all__ = ["TableWriter", "part_path"]

_ROW_GROUP = 122_880
_PIECES = 256
"""Tables that wait side by side before they are put together: one of a few rows takes a hundred times its values."""
_DISTINCT = ("id", "properties")
"""Columns of texts that hardly repeat: a dictionary of them would only cost."""


def part_path(table: str, number: int, sha256: str) -> str:
    """Path of a part of a table, relative to the dataset.

    Another content has another name, so whoever reads by an old manifest never meets new rows.
    """
    return f"{table}/part-{number:05}-{sha256[:12]}.parquet"


class TableWriter:
    """Collects rows of a table and writes them in row groups of one size, however they come in."""

    def __init__(self, folder: Path, table: str, number: int = 0, *, row_group: int = _ROW_GROUP) -> None:
        """Open a file under a temporary name.

        Args:
            folder: The dataset's folder.
            table: A key of `SCHEMAS`.
            number: The part's number.
            row_group: The rows of a row group.

        Raises:
            OSError: The folder cannot be written.
        """
        metadata = {"scenicq_schema": str(SCHEMA_VERSION)} | ({"geo": GEO_METADATA} if table == "regions" else {})
        self._schema = SCHEMAS[table].with_metadata(metadata)
        self._folder, self._table, self._number = folder, table, number
        self._temporary = folder / table / f"part-{number:05}.{os.getpid()}.tmp"
        self._temporary.parent.mkdir(exist_ok=True)
        self._few: list[ArrowTable] = []
        self._pending: list[ArrowTable] = []
        self._pending_rows = 0
        self._rows = 0
        self._row_group = row_group
        texts = [field.name for field in self._schema if field.type == pa.string() and field.name not in _DISTINCT]
        reals = [field.name for field in self._schema if field.type == pa.float64()]
        self._writer = pq.ParquetWriter(
            self._temporary,
            self._schema,
            compression="zstd",
            # A dictionary of floats only costs: they hardly repeat. Splitting their bytes compresses better.
            use_dictionary=texts,
            use_byte_stream_split=reals,
        )

    def add(self, rows: ArrowTable) -> None:
        """Append rows of the table's schema."""
        self._few.append(rows)
        if len(self._few) == _PIECES:
            self._pending.append(pa.concat_tables(self._few).combine_chunks())
            self._few = []
        self._pending_rows += len(rows)
        self._rows += len(rows)
        if self._pending_rows >= self._row_group:
            self._flush(self._pending_rows // self._row_group * self._row_group)

    def end_group(self, least: int) -> None:
        """Let a row group end here, if it has so many rows: a search for what follows reads no more than that.

        Args:
            least: The fewest rows of a row group.
        """
        if self._pending_rows >= least:
            self._flush(self._pending_rows)

    def finish(self) -> Part:
        """Write what is left, sync, give the file its name, and describe it."""
        if self._pending_rows:
            self._flush(self._pending_rows)
        self._writer.close()
        with self._temporary.open("rb+") as file:
            os.fsync(file.fileno())
            digest = hashlib.file_digest(file, "sha256").hexdigest()
            size = os.fstat(file.fileno()).st_size
        relative = part_path(self._table, self._number, digest)
        self._temporary.replace(self._folder / relative)
        sync_folder(self._temporary.parent)
        return Part(relative, size, digest, self._rows)

    @property
    def rows(self) -> int:
        """Rows added so far."""
        return self._rows

    def abandon(self) -> None:
        """Close the file without finishing it, and remove it."""
        self._writer.close()
        self._temporary.unlink(missing_ok=True)

    def _flush(self, rows: int) -> None:
        table = pa.concat_tables([*self._pending, *self._few]).combine_chunks()
        self._writer.write_table(table.slice(0, rows), row_group_size=self._row_group)
        rest = table.slice(rows)
        self._pending, self._few = [rest] if len(rest) else [], []
        self._pending_rows = len(rest)
