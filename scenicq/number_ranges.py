"""Ranges of whole numbers, one after the other: the rows that belong to each of some owners."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["expand_ranges"]


def expand_ranges(firsts: NDArray[Any] | int, counts: NDArray[Any]) -> NDArray[np.int64]:
    """From each first number so many that follow, one range after the other.

    Args:
        firsts: Where each range begins, shape (n,); or one number for all of them.
        counts: How many numbers each has, shape (n,); none is negative.

    Returns:
        The numbers, shape (the sum of the counts,).
    """
    counts = counts.astype(np.int64)
    before = np.cumsum(counts) - counts
    return np.arange(counts.sum(), dtype=np.int64) + np.repeat(np.asarray(firsts, np.int64) - before, counts)
