"""Columns of some rows of a Parquet file, read group by group, so that memory depends on those rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from scenicq.store.place import StoreFile, open_parquet

__all__ = ["RowColumns"]

_Number = TypeVar("_Number", np.float64, np.int64)


class RowColumns:
    """A Parquet file, of which columns are read when they are asked for; rows are given in ascending order."""

    def __init__(self, file: StoreFile, texts: Sequence[str]) -> None:
        """Open a file.

        Args:
            file: The file.
            texts: The columns of which `codes` are asked for.
        """
        self._file = open_parquet(file, read_dictionary=[*texts])
        self._metadata = self._file.metadata
        sizes = [self._metadata.row_group(group).num_rows for group in range(self._file.num_row_groups)]
        self._starts = np.cumsum([0, *sizes])
        leaves = self._metadata.schema
        self._leaf = {leaves.column(number).path: number for number in range(len(leaves))}
        self._texts: dict[tuple[str, int], Any] = {}

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __contains__(self, name: str) -> bool:
        """Whether the file has a column."""
        return name in self._leaf

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
                found[part] = self._read(name, group).to_numpy()[places]
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
                found[part] = np.concatenate([_coded(each, numbers) for each in self._read(name, group).chunks])[places]
        found[found < 0] = len(numbers)
        return found, [*numbers]

    def texts(self, name: str, rows: NDArray[np.int64]) -> list[str]:
        """The texts in some rows, which may be in any order, of a column without null."""
        order = np.argsort(rows, kind="stable")
        ordered, found = rows[order], np.empty(len(rows), dtype=object)
        # a row may be asked for twice
        for group, part, _ in self._groups(ordered):
            if (name, group) not in self._texts:
                self._texts[name, group] = self._read(name, group)
            found[order[part]] = self._texts[name, group].take(ordered[part] - self._starts[group]).to_pylist()
        return found.tolist()

    def _groups(self, rows: NDArray[np.int64]) -> Iterator[tuple[int, slice, NDArray[np.int64] | slice]]:
        """The groups that have some rows: each with which of them are its own, and their places in it."""
        cuts = np.searchsorted(rows, self._starts).tolist()
        for group, (low, high) in enumerate(pairwise(cuts)):
            if low < high:
                first, size = int(self._starts[group]), int(self._starts[group + 1] - self._starts[group])
                places = slice(None) if high - low == size else rows[low:high] - first
                yield group, slice(low, high), places

    def _read(self, name: str, group: int) -> Any:
        return self._file.read_row_group(group, columns=[name], use_threads=False)[name]

    def _statistics(self, name: str, group: int) -> Any:
        """What the file says of a column of a group; None if it does not say all."""
        found = self._metadata.row_group(group).column(self._leaf[name]).statistics
        return found if found is not None and found.has_null_count else None


def _coded(texts: Any, numbers: dict[str, int]) -> NDArray[np.int32]:
    """The numbers of texts with a dictionary, whose texts get numbers; -1 for null."""
    own = [numbers.setdefault(text, len(numbers)) for text in texts.dictionary.to_pylist()]
    indices = texts.indices.to_numpy(zero_copy_only=False)
    if texts.null_count:
        indices = np.where(np.isnan(indices), len(own), indices).astype(np.int64)
    return np.array([*own, -1], np.int32)[indices]
