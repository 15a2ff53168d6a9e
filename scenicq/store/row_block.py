"""The one reader of rows of a dataset that is known to be sound: some rows of a file, as a table or column by column.

Only the row groups that hold them are decoded, so that memory depends on those rows. What is not checked yet is read
forwards by `part_rows`, whatever the sizes of its groups.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise
from typing import TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from scenicq.store.place import StoreFile, open_parquet
from scenicq.store.schema import ArrowTable

__all__ = ["RowBlock"]

_REPEATED = ("class", "track", "recording", "map", "channel", "attributes", "params")
"""Ends of the names of columns with few distinct texts in many rows: decoding each once is several times faster."""
_Number = TypeVar("_Number", np.float64, np.int64)


class RowBlock:
    """The rows of a file as one range of numbers; a context manager.

    Rows are given in ascending order, each once. Nothing is read before it is asked for.
    """

    def __init__(self, file: StoreFile, columns: Sequence[str] = (), *, texts: Collection[str] = ()) -> None:
        """Open a file.

        Args:
            file: The file.
            columns: What `take` gives.
            texts: The columns of which `codes` are asked for.
        """
        self._columns = list(columns)
        shared = [name for name in columns if name.endswith(_REPEATED) and name not in texts]
        self._file = open_parquet(file, read_dictionary=[*shared, *texts])
        self._metadata = self._file.metadata
        sizes = [self._metadata.row_group(group).num_rows for group in range(self._file.num_row_groups)]
        self._starts = np.cumsum([0, *sizes])
        leaves = self._metadata.schema
        self._leaf = {leaves.column(number).path: number for number in range(len(leaves))}
        self._texts: dict[tuple[str, int], pa.ChunkedArray] = {}
        self._decoded: tuple[int, ArrowTable] | None = None

    def __enter__(self) -> RowBlock:
        """Nothing is read yet."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the file."""
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __len__(self) -> int:
        """The number of rows."""
        return int(self._starts[-1])

    def __contains__(self, name: str) -> bool:
        """Whether the file has a column."""
        return name in self._leaf

    def take(self, rows: NDArray[np.int64]) -> ArrowTable:
        """Some rows as a table; the group that was decoded last is kept, as the next rows may lie in it, too."""
        pieces: list[ArrowTable] = []
        for group, _, places in self._groups(rows):
            if self._decoded is None or self._decoded[0] != group:
                self._decoded = group, self._read(self._columns, group)
            table = self._decoded[1]
            together = isinstance(places, slice)
            pieces.append(table.slice(places.start, places.stop - places.start) if together else table.take(places))
        return pa.concat_tables(pieces) if pieces else pa.table({name: [] for name in self._columns})

    def numbers(self, name: str, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Real numbers; nan for null."""
        return self._values(name, rows, np.empty(len(rows)))

    def integers(self, name: str, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Whole numbers of a column without null."""
        return self._values(name, rows, np.empty(len(rows), np.int64))

    def _values(self, name: str, rows: NDArray[np.int64], found: NDArray[_Number]) -> NDArray[_Number]:
        for group, part, places in self._groups(rows):
            known = self._statistics(name, group)
            if known is not None and known.num_values == 0:
                found[part] = np.nan
            else:
                found[part] = self._column(name, group).to_numpy()[places]
        return found

    def codes(self, name: str, rows: NDArray[np.int64]) -> tuple[NDArray[np.int32], list[str]]:
        """The number of each row's text, and the distinct texts; null has the number after the last."""
        numbers: dict[str, int] = {}
        found = np.empty(len(rows), np.int32)
        for group, part, places in self._groups(rows):
            known = self._statistics(name, group)
            if known is not None and known.num_values == 0:
                found[part] = -1
            elif known is not None and known.has_min_max and known.null_count == 0 and known.min == known.max:
                found[part] = numbers.setdefault(known.min, len(numbers))
            else:
                coded = [_coded(each, numbers) for each in self._column(name, group).chunks]
                found[part] = np.concatenate(coded)[places]
        found[found < 0] = len(numbers)
        return found, [*numbers]

    def texts(self, name: str, rows: NDArray[np.int64]) -> list[str]:
        """The texts in some rows, which may be in any order and come again, of a column without null."""
        order = np.argsort(rows, kind="stable")
        ordered, found = rows[order], np.empty(len(rows), dtype=object)
        for group, part, _ in self._groups(ordered):
            if (name, group) not in self._texts:
                self._texts[name, group] = self._column(name, group)
            found[order[part]] = self._texts[name, group].take(ordered[part] - self._starts[group]).to_pylist()
        return found.tolist()

    def _groups(self, rows: NDArray[np.int64]) -> Iterator[tuple[int, slice, NDArray[np.int64] | slice]]:
        """The groups that have some rows: each with which of them are its own, and their places in it."""
        cuts = np.searchsorted(rows, self._starts).tolist()
        for group, (low, high) in enumerate(pairwise(cuts)):
            if low < high:
                first, last = (int(rows[each] - self._starts[group]) for each in (low, high - 1))
                together = last - first == high - low - 1
                places = slice(first, last + 1) if together else rows[low:high] - self._starts[group]
                yield group, slice(low, high), places

    def _column(self, name: str, group: int) -> pa.ChunkedArray:
        return self._read([name], group)[name]

    def _read(self, columns: list[str], group: int) -> ArrowTable:
        # the threads of pyarrow share columns among them
        return self._file.read_row_group(group, columns=columns, use_threads=len(columns) > 1)

    def _statistics(self, name: str, group: int) -> pq.Statistics | None:
        """What the file says of a column of a group; None if it does not say all."""
        found = self._metadata.row_group(group).column(self._leaf[name]).statistics
        return found if found is not None and found.has_null_count else None


def _coded(texts: pa.Array, numbers: dict[str, int]) -> NDArray[np.int32]:
    """The numbers of texts with a dictionary, whose texts get numbers; -1 for null."""
    own = [numbers.setdefault(text, len(numbers)) for text in texts.dictionary.to_pylist()]
    indices = texts.indices.to_numpy(zero_copy_only=False)
    if texts.null_count:
        indices = np.where(np.isnan(indices), len(own), indices).astype(np.int64)
    return np.array([*own, -1], np.int32)[indices]
