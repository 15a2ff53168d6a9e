"""Which intervals are reported."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenicq.temporal.interval_options import Intervals
from scenicq.temporal.truth import FALSE, TRUE, Truth

__all__ = ["choose_intervals"]


def choose_intervals(
    starts: NDArray[np.int64],
    ends: NDArray[np.int64],
    truth: Truth,
    lasting_s: NDArray[np.float64],
    intervals: Intervals,
    min_duration_s: float,
) -> NDArray[np.int64]:
    """The numbers of the intervals to report, in order of time.

    One that is not sure counts only where no match overlaps it. Intervals of several bindings lie one after the other.

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
        sure = int(np.count_nonzero(truth[left] == TRUE))
        kept = _apart(starts[left[:sure]], ends[left[:sure]])
        unsure = left[sure:]
        if kept and len(unsure):
            # those that overlap no match, whether that lies at an end of them or between
            first = int(starts[left].min())
            before = np.zeros(int(ends[left].max()) - first + 2, np.int64)
            for number in left[kept].tolist():
                before[starts[number] - first + 1 : ends[number] - first + 2] = 1
            before = np.cumsum(before)
            unsure = unsure[before[ends[unsure] - first + 1] == before[starts[unsure] - first]]
        left = np.concatenate((left[kept], unsure[_apart(starts[unsure], ends[unsure])]))
    return left[np.lexsort((ends[left], starts[left]))]


def _apart(starts: NDArray[np.int64], ends: NDArray[np.int64]) -> list[int]:
    """The numbers of intervals that overlap none of those before them that are kept; the longest come first."""
    if not len(starts):
        return []
    first = int(starts.min())
    taken = bytearray(int(ends.max()) - first + 1)
    found: list[int] = []
    for number, (start, end) in enumerate(zip((starts - first).tolist(), (ends - first).tolist(), strict=True)):
        # what is kept is not shorter, so it reaches over an end of whatever it overlaps
        if not taken[start] and not taken[end]:
            found.append(number)
            taken[start : end + 1] = b"\1" * (end + 1 - start)
    return found
