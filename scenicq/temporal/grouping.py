"""Whole numbers that are equal, found in arrays of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

__all__ = ["distinct", "group_equal", "groups", "values_of"]

Places = NDArray[np.int64]


def groups(numbers: NDArray[np.int64]) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Equal numbers, with the places of each."""
    if not len(numbers):
        return
    if (numbers == numbers[0]).all():
        yield int(numbers[0]), np.arange(len(numbers))
        return
    order = np.argsort(numbers, kind="stable")
    cuts = np.flatnonzero(np.diff(numbers[order])) + 1
    for some in np.split(order, cuts):
        yield int(numbers[some[0]]), some


def values_of(numbers: NDArray[np.int64]) -> list[int]:
    """The small numbers that there are."""
    return np.flatnonzero(np.bincount(numbers)).tolist() if len(numbers) else []


def distinct(places: Places, size: int) -> Places:
    """Places in order, each once."""
    if len(places) < size // 8:
        return np.unique(places)
    there = np.zeros(size, np.bool_)
    there[places] = True
    return np.flatnonzero(there)


def group_equal(code: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For each of the distinct numbers a place that has it, and for each place which of them is its own."""
    size = int(code.max(initial=0)) + 1
    if size > 4 * len(code) + 1024:
        _, firsts, which = np.unique(code, return_index=True, return_inverse=True)
        return firsts, which.reshape(-1).astype(np.int64)
    first = np.full(size, -1)
    first[code] = np.arange(len(code))
    values = np.flatnonzero(first >= 0)
    number = np.zeros(size, np.int64)
    number[values] = np.arange(len(values))
    return first[values], number[code]
