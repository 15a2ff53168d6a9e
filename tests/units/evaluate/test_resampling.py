"""What chance can do, against what can be counted."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from scenicq.evaluate.resampling import (
    CLUSTERS,
    count_test,
    difference_interval,
    effective_number,
    holm,
    interval_of,
    ratio_interval,
    resamples,
    sign_flip_test,
    student,
    wilson,
)


@pytest.mark.parametrize(
    ("rate", "number", "reach"), [(0.1, 30.0, 1.96), (0.0, 12.0, 2.5), (1.0, 5.0, 2.1), (0.4, 7.5, 2)]
)
def test_a_share_is_in_its_interval_if_what_is_found_is_not_too_far(rate: float, number: float, reach: float) -> None:
    low, high = wilson(rate, number, reach)
    truths = np.linspace(0, 1, 100_001)
    near = truths[np.abs(rate - truths) <= reach * np.sqrt(truths * (1 - truths) / number) + 1e-12]
    assert (low, high) == pytest.approx((near.min(), near.max()), abs=1e-4)


def test_clusters_of_one_object_are_objects() -> None:
    values = np.array([1.0] * 12 + [0.0] * 28)
    found = ratio_interval(values, np.ones(40))
    # the variance of a sample has one less in its denominator
    assert found == pytest.approx(wilson(0.3, 39, student(0.95, 40)))


def test_objects_of_a_cluster_that_are_all_alike_tell_as_much_as_one() -> None:
    rng = np.random.default_rng(0)
    values = (rng.random(50) < 0.3).astype(np.float64)
    one, many = ratio_interval(values, np.ones(50)), ratio_interval(9 * values, np.full(50, 9.0), 450.0)
    assert one == pytest.approx(many)


def test_below_five_clusters_there_is_no_interval() -> None:
    for clusters in (4, 5):
        there = clusters >= CLUSTERS
        assert math.isfinite(ratio_interval(np.ones(clusters), np.full(clusters, 3.0))[0]) == there
        assert math.isfinite(interval_of(np.arange(100.0), float(clusters))[0]) == there


def test_a_difference_of_shares_that_are_known_is_known() -> None:
    low, high = difference_interval(0.5, 0.2, (1e9, 1e9), 1.96)
    assert (low, high) == pytest.approx((0.3, 0.3), abs=1e-3)
    # Newcombe 1998, table II: 56/70 against 48/80
    assert difference_interval(56 / 70, 48 / 80, (70, 80), 1.959964) == pytest.approx((0.0524, 0.3339), abs=5e-5)


def test_quantiles_of_students_distribution() -> None:
    for clusters, quantile in ((6, 2.5706), (11, 2.2281), (31, 2.0423)):
        assert student(0.95, clusters) == pytest.approx(quantile, rel=0.01)


def test_all_flips_of_few_clusters() -> None:
    rng = np.random.default_rng(3)
    for count in (1, 2, 5, 8):
        scores = rng.normal(0.5, 1, count)

        def far(signs: tuple[float, ...], scores: np.ndarray = scores) -> float:
            flipped = np.array(signs) * scores
            return abs(flipped.sum()) / math.sqrt(max(np.square(flipped - flipped.mean()).sum(), 1e-30))

        found = [
            far(signs) >= far((1.0,) * count) * (1 - 1e-9) for signs in itertools.product((1.0, -1.0), repeat=count)
        ]
        assert sign_flip_test(scores, rng) == pytest.approx(sum(found) / len(found))


def test_flips_that_are_drawn_come_close_to_all() -> None:
    scores = np.random.default_rng(4).normal(0.4, 1, 12)
    exact = sign_flip_test(scores, np.random.default_rng(0))
    # a cluster that says nothing changes nothing, but there are too many to flip all
    tiny = np.append(scores, 1e-9)
    assert sign_flip_test(tiny, np.random.default_rng(0)) == pytest.approx(exact, abs=0.03)
    assert sign_flip_test(np.zeros(4), np.random.default_rng(0)) == 1


@pytest.mark.parametrize(
    ("own", "size", "others", "other"), [(3, 10, 12, 100), (0, 6, 3, 40), (9, 9, 1, 20), (5, 50, 5, 50)]
)
def test_counts_of_two_groups(own: int, size: int, others: int, other: int) -> None:
    missed = own + others
    ways = {
        k: math.comb(size, k) * math.comb(other, missed - k)
        for k in range(max(0, missed - other), min(size, missed) + 1)
    }
    total = sum(ways.values())
    below = sum(way for k, way in ways.items() if k < own) / total
    above = sum(way for k, way in ways.items() if k > own) / total
    expected = min(1.0, 2 * (min(below, above) + ways[own] / total / 2))
    assert count_test(own / size, others / other, (size, other)) == pytest.approx(expected)


def test_effective_number_of_recordings() -> None:
    assert effective_number(np.array([7.0, 7.0, 7.0, 0.0])) == pytest.approx(3)
    assert effective_number(np.array([100.0, 1.0])) == pytest.approx(1.02, abs=0.01)
    assert effective_number(np.zeros(3)) == 0


def test_resamples_draw_as_many_as_there_are() -> None:
    drawn = resamples(7, np.random.default_rng(0), 50)
    assert drawn.shape == (50, 7)
    assert (drawn.sum(axis=1) == 7).all()
    assert resamples(0, np.random.default_rng(0)).shape[1] == 0


def test_several_tests_are_corrected() -> None:
    """The example of Holm's paper: thresholds grow from one test to the next, and order is kept."""
    found = holm(np.array([0.01, math.nan, 0.04, 0.03, 0.005]))
    assert found[[0, 2, 3, 4]] == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert math.isnan(found[1])
