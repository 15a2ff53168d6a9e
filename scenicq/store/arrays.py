"""Make Arrow arrays of NumPy arrays, and of texts that repeat.

pyarrow has all of this, but loads `pyarrow.compute` and `numpy.ma` for it: more time than a small ingest takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import chain, repeat
from operator import mul
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenicq.number_ranges import expand_ranges
from scenicq.store.schema import ArrowArray

__all__ = ["FEW", "MOST_BYTES", "Texts", "lists_at", "number_array", "repeated_texts"]

MOST_BYTES = 2**31 - 1
"""What an array of texts can hold."""

FEW = 200_000
"""Texts that are taken one by one, which takes less time than to load `pyarrow.compute`."""


@cache
def _dtype(kind: pa.DataType) -> np.dtype[Any]:
    """NumPy's type of a `pyarrow` type of numbers, which `pyarrow` tells before version 26 only where pandas is."""
    return pa.array([], kind).to_numpy().dtype


def number_array(values: NDArray[Any], kind: pa.DataType) -> ArrowArray:
    """Numbers or truth values of shape (n,) as an array of a type that can hold them; nan becomes null.

    Args:
        values: Numbers that the type can hold.
        kind: A `pyarrow` type of numbers or truth values.
    """
    if values.dtype == np.bool_:
        return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(np.packbits(values, bitorder="little"))])
    values = np.ascontiguousarray(values, dtype=_dtype(kind))
    there = ~np.isnan(values) if values.dtype.kind == "f" else None
    valid = None if there is None or there.all() else pa.py_buffer(np.packbits(there, bitorder="little"))
    return pa.Array.from_buffers(kind, len(values), [valid, pa.py_buffer(values)])


def lists_at(values: Sequence[Sequence[float]], at: NDArray[np.intp]) -> ArrowArray:
    """Pick lists by their numbers, shape (n,), in that order."""
    sizes = np.fromiter(map(len, values), np.int64, len(values))
    flat = np.fromiter(chain.from_iterable(values), np.float64, int(sizes.sum()))
    starts, many = np.cumsum(sizes) - sizes, sizes[at]
    ends = np.cumsum(many)
    places = expand_ranges(starts[at], many)
    return pa.Array.from_buffers(
        pa.list_(pa.float64()),
        len(at),
        [None, pa.py_buffer(_offsets(ends))],
        children=[number_array(flat[places], pa.float64())],
    )


class Texts:
    """A few texts, from which long columns are made by number."""

    def __init__(self, texts: Sequence[str]) -> None:
        """Take the texts."""
        self._texts = [*texts, None]
        self._array: ArrowArray | None = None
        self._taken = 0

    def at(self, numbers: NDArray[np.int64]) -> ArrowArray:
        """Pick texts by their numbers, shape (n,), in that order; null for -1."""
        self._taken += len(numbers)
        if self._taken <= FEW:
            return pa.array(list(map(self._texts.__getitem__, numbers.tolist())), pa.string())
        if self._array is None:
            self._array = pa.array(self._texts[:-1], pa.string())
        return self._array.take(pa.array(numbers, mask=numbers < 0))


def repeated_texts(texts: Sequence[str], counts: NDArray[np.int64]) -> ArrowArray:
    """Repeat each text as often as `counts` says, one after the other."""
    times = counts.tolist()
    content = "".join(map(mul, texts, times))
    if not content.isascii() or len(content) > MOST_BYTES:
        return pa.array(list(chain.from_iterable(map(repeat, texts, times))), pa.string())
    ends = np.cumsum(np.repeat(np.fromiter(map(len, texts), np.int64, len(texts)), counts))
    buffers = [None, pa.py_buffer(_offsets(ends)), pa.py_buffer(content.encode())]
    return pa.Array.from_buffers(pa.string(), len(ends), buffers)


def _offsets(ends: NDArray[np.int64]) -> NDArray[np.int32]:
    """Where each value begins, and the end of the last."""
    offsets = np.zeros(len(ends) + 1, dtype=np.int32)
    offsets[1:] = ends
    return offsets
