"""Intervals hold what they say, tests alarm as rarely as they say, on models whose rate of failure is known."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from scenicq.evaluate.resampling import (
    StratumCounts,
    effective_number,
    holm,
    rate_interval,
    rates,
    resamples,
    sign_flip_test,
)

sys.path.insert(0, str(Path(__file__).parent))
from worlds import World, layered, planted, world


@pytest.mark.slow
@pytest.mark.parametrize("more", [0.0, 0.15])
@pytest.mark.parametrize("make", [world, layered])
def test_planted_truth(more: float, make: World) -> None:
    """500 datasets of 30 recordings: coverage 93 to 97 %, false alarms 3.5 to 6.5 %."""
    held, differences, alarms = planted(500, 30, 0.12, more, 2000, 1999, make)
    assert 0.93 <= held <= 0.97
    assert 0.93 <= differences <= 0.97
    if more:
        assert alarms > 0.9
    else:
        assert 0.035 <= alarms <= 0.065


def test_planted_truth_in_short() -> None:
    held, differences, alarms = planted(60, 30, 0.12, 0.0, 300, 199)
    assert held >= 0.85
    assert differences >= 0.85
    assert alarms <= 0.15
    assert planted(20, 30, 0.12, 0.3, 100, 199)[2] >= 0.9


def test_others_are_spread_as_the_group_is() -> None:
    """Far objects are missed more often; a group that is far is compared with others that are."""
    counts = StratumCounts(
        np.array([[1.0, 8.0]]), np.array([[10.0, 10.0]]), np.array([[10.0, 8.0]]), np.array([[100.0, 10.0]])
    )
    mine, others = rates(counts, np.ones((1, 1)))
    assert mine[0] == pytest.approx(0.45)
    assert others[0] == pytest.approx((0.1 * 10 + 0.8 * 10) / 20)


def test_strata_without_others_do_not_count() -> None:
    counts = StratumCounts(
        np.array([[5.0, 1.0]]), np.array([[5.0, 4.0]]), np.array([[0.0, 1.0]]), np.array([[0.0, 4.0]])
    )
    assert rates(counts, np.ones((1, 1)))[1][0] == pytest.approx(0.25)
    assert counts.comparable.tolist() == [False, True]


def test_effective_number_of_recordings() -> None:
    assert effective_number(np.array([7.0, 7.0, 7.0, 0.0])) == pytest.approx(3)
    assert effective_number(np.array([100.0, 1.0])) == pytest.approx(1.02, abs=0.01)
    assert effective_number(np.zeros(3)) == 0


def test_nothing_missed_is_no_certainty() -> None:
    low, high = rate_interval(np.zeros(100), 0.0, 10.0)
    assert low == 0
    assert high == pytest.approx(0.3085, abs=1e-4)
    assert rate_interval(np.ones(100), 1.0, 10.0)[0] == pytest.approx(1 - 0.3085, abs=1e-4)
    assert all(math.isnan(end) for end in rate_interval(np.zeros(1), math.nan, 0.0))


def test_holm() -> None:
    found = holm(np.array([0.01, 0.04, math.nan, 0.03]))
    assert found[[0, 1, 3]].tolist() == pytest.approx([0.03, 0.06, 0.06])
    assert math.isnan(found[2])


def test_the_same_seed_gives_the_same() -> None:
    counts = world(np.random.default_rng(3), 20, 0.2, 0.1)
    first, second = (sign_flip_test(counts, np.random.default_rng(5), 499) for _ in range(2))
    assert first == second
    assert resamples(4, np.random.default_rng(0), 3).sum(axis=1).tolist() == [4, 4, 4]
