"""Ranges of numbers one after the other, against the plain definition."""

from __future__ import annotations

import numpy as np
import pytest

from scenicq.number_ranges import expand_ranges


@pytest.mark.parametrize("kind", [np.int8, np.uint8, np.int32, np.uint64, np.int64])
def test_each_range_follows_the_one_before(kind):
    rng = np.random.default_rng(5)
    for n in (0, 1, 2, 7, 40):
        firsts, counts = rng.integers(0, 100, n).astype(kind), rng.integers(0, 9, n).astype(kind)
        plain = [first + step for first, count in zip(firsts.tolist(), counts.tolist(), strict=True)
                 for step in range(count)]  # fmt: skip
        found = expand_ranges(firsts, counts)
        assert found.tolist() == plain
        assert found.dtype == np.int64
        assert expand_ranges(3, counts).tolist() == [3 + step for count in counts.tolist() for step in range(count)]
