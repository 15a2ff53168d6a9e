"""The rows of one file of a table in order, read forwards in batches, so that memory does not grow with the file."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pyarrow as pa

from scenicq.store.place import StoreFile, open_parquet
from scenicq.store.schema import SCHEMAS, ArrowTable
from scenicq.store.validation import check_columns, decoding

__all__ = ["PartRows"]

_BATCH = 16_384
"""Rows that are decoded at a time."""


class PartRows:
    """Reads one file of a table forwards; to be closed."""

    def __init__(self, table: str, file: StoreFile, name: str) -> None:
        """Open a file, whose columns must be those of the table.

        Args:
            table: A key of `SCHEMAS`.
            file: The file.
            name: What it is called in the dataset.

        Raises:
            DataError: dataset-invalid.
            OSError: It cannot be read.
        """
        self.name = name
        self._file = file
        self._schema = SCHEMAS[table]
        with decoding(name):
            self._parquet = open_parquet(file)
            check_columns(self._parquet, list(self._schema), self._parquet.schema_arrow.names, name)
        sizes = [self._parquet.metadata.row_group(group).num_rows for group in range(self._parquet.num_row_groups)]
        self._ends = [sum(sizes[: group + 1]) for group in range(len(sizes))]
        self.rows: int = sum(sizes)
        self._first = 0
        self._there: ArrowTable = self._schema.empty_table()
        self._batches = self._from_group(0)

    def take(self, first: int, count: int) -> ArrowTable:
        """Read some rows; those before them are skipped, whole row groups of them unread.

        Args:
            first: The first row, not before the end of what was taken before.
            count: How many; the result has fewer where the file ends.

        Raises:
            DataError: dataset-invalid.
            OSError: The file cannot be read.
        """
        group = sum(end <= first for end in self._ends)
        before = self._ends[group - 1] if group else 0
        if before > self._first + len(self._there):
            self._first, self._there = before, self._schema.empty_table()
            self._batches = self._from_group(group)
        pieces, begin = [self._there], self._first
        end = begin + len(self._there)
        with decoding(self.name):
            while end < first + count and (batch := next(self._batches, None)) is not None:
                if end <= first:
                    pieces, begin = [], end
                pieces.append(pa.Table.from_batches([batch]).replace_schema_metadata())
                end += len(batch)
        rows = pa.concat_tables(pieces)
        self._first = min(first + count, end)
        self._there = rows.slice(self._first - begin)
        return rows.slice(min(first, end) - begin, count)

    def runs(self, column: str) -> list[int]:
        """The length of each run of neighbouring rows with the same text.

        Args:
            column: A column of texts without null, of which a dictionary is read.

        Raises:
            DataError: dataset-invalid.
            OSError: The file cannot be read.
        """
        import pyarrow.compute as pc  # noqa: PLC0415 - takes longer to load than a small ingest does

        with decoding(self.name), open_parquet(self._file, read_dictionary=[column]) as parquet:
            codes = pc.run_end_encode(parquet.read([column]).column(0).unify_dictionaries().combine_chunks().indices)
        return np.diff(codes.run_ends.to_numpy(), prepend=0).tolist()

    def close(self) -> None:
        """Close the file."""
        self._parquet.close()

    def _from_group(self, group: int) -> Iterator[pa.RecordBatch]:
        groups = list(range(group, len(self._ends)))
        return iter(self._parquet.iter_batches(batch_size=_BATCH, row_groups=groups, use_threads=False))
