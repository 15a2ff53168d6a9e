"""Intervals that are reported against the definition: the longest, then whatever overlaps none before it."""

import random

import numpy as np

from scenicq.temporal.selection import chosen


def expected(intervals: list[tuple[int, int, int, float]], least: float) -> list[tuple[int, int]]:
    """The intervals (start, end, truth, seconds) that are kept."""
    kept: list[tuple[int, int]] = []
    for start, end, truth, lasting in sorted(intervals, key=lambda each: (-each[2], -each[3], each[0])):
        if truth > 0 and lasting >= least - 1e-6 and all(end < a or b < start for a, b in kept):
            kept.append((start, end))
    return sorted(kept)


def test_the_longest_of_overlapping_intervals_are_kept():
    draw = random.Random(1)
    compared = 0
    for _ in range(400):
        times = np.cumsum([draw.choice([1, 2, 5]) for _ in range(80)]) / 10
        first = draw.randint(0, 40)
        found = []
        for _ in range(draw.randint(0, 12)):
            start = first + draw.randint(0, 20)
            end = start + draw.randint(0, 8)
            found.append((start, end, draw.choice([0, 1, 2]), float(times[end] - times[start])))
        starts, ends, truth, lasting = (np.array([each[k] for each in found], dtype=np.float64) for k in range(4))
        starts, ends = starts.astype(np.int64), ends.astype(np.int64)
        kept = chosen(starts, ends, truth.astype(np.int8), lasting, "longest", 0.3)
        assert list(zip(starts[kept].tolist(), ends[kept].tolist(), strict=True)) == expected(found, 0.3)
        compared += len(kept)
    assert compared > 500
