"""Which of the intervals of one binding are reported."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenicq.temporal.interval_options import Intervals
from scenicq.temporal.truth import FALSE, Truth

__all__ = ["chosen"]


def chosen(
    starts: NDArray[np.int64],
    ends: NDArray[np.int64],
    truth: Truth,
    lasting_s: NDArray[np.float64],
    intervals: Intervals,
    min_duration_s: float,
) -> NDArray[np.int64]:
    """The numbers of the intervals to report, in order of time.

    One that is not sure counts only where no match overlaps it.

    Args:
        starts: First samples.
        ends: Last samples, included.
        truth: Whether each matches.
        lasting_s: How long each lasts.
        intervals: Which.
        min_duration_s: How long they must last at least.
    """
    left = np.flatnonzero((truth > FALSE) & (lasting_s >= min_duration_s - 1e-6))
    if intervals == "longest":
        left = left[np.lexsort((starts[left], -lasting_s[left], -truth[left].astype(np.int64)))]
        kept: list[int] = []
        while len(left):
            best = left[0]
            kept.append(int(best))
            left = left[(ends[left] < starts[best]) | (ends[best] < starts[left])]
        left = np.array(kept, dtype=np.int64)
    return left[np.lexsort((ends[left], starts[left]))]
