"""Intervals and tests over clusters of frames that resemble each other: recordings, or drives of several.

A share has the interval of Wilson (1927) at its effective number of objects: how many would vary as much as the share
varies over clusters (Korn and Graubard 1998, "Confidence intervals for proportions with small expected number of
positive counts estimated from survey data"), with Student's quantile of as many degrees of freedom as there are
clusters, less one. A difference of two shares has the interval that theirs make (Newcombe 1998, "Interval estimation
for the difference between independent proportions", method 10; of two models on the same objects "Improved confidence
intervals for the difference between binomial proportions based on paired data", 1998, method 10). Differences are
tested twice, and the greater p-value counts: by flipping the signs of the clusters' contributions (Hemerik, Goeman and
Finos 2020, "Robust testing in generalized linear models by sign flipping score contributions"), which knows how
clusters differ, and by the exact test of two counts at their effective numbers, which knows how little few objects and
few misses say. Other figures have percentiles of the bootstrap over clusters, moved outward for few of them (Hesterberg
2015, "What teachers should know about the bootstrap", section 5.3).
"""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "CLUSTERS",
    "LEVEL",
    "Interval",
    "count_test",
    "difference_interval",
    "discordance_test",
    "effective_number",
    "holm",
    "interval_of",
    "means_by",
    "ratio_interval",
    "resamples",
    "sign_flip_test",
    "student",
    "sums_by",
    "wilson",
]

Reals = NDArray[np.float64]
Interval = tuple[float, float]

RESAMPLES = 2000
FLIPS = 4999
CLUSTERS = 5.0
"""Below this effective number of clusters there is no interval."""
_ALL_FLIPS = 12
"""Up to so many clusters all flips are made."""
_AT_ONCE = 250
"""Flips of all clusters that are drawn at once."""
LEVEL = 0.95
"""How often an interval holds the truth."""


def sums_by(number: NDArray[np.int64], values: Reals | NDArray[np.bool_], count: int = 0) -> Reals:
    """The sum of the values of each cluster, shape (clusters,).

    Args:
        number: The cluster of each value, shape (n,).
        values: Shape (n,).
        count: How many clusters there are at least.
    """
    return np.bincount(number, weights=values, minlength=count).astype(np.float64)


def means_by(number: NDArray[np.int64], values: Reals, weights: Reals) -> Reals:
    """The weighted mean of each value's group, 0 where it has no weight, shape (n,).

    Args:
        number: The group of each value, shape (n,).
        values: Shape (n,).
        weights: How much each counts, shape (n,).
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num(sums_by(number, weights * values) / sums_by(number, weights))[number]


def resamples(clusters: int, rng: np.random.Generator, count: int = RESAMPLES) -> Reals:
    """How often each cluster is drawn in each resample, shape (count, clusters)."""
    if clusters == 0:
        return np.zeros((count, 0))
    return rng.multinomial(clusters, np.full(clusters, 1.0 / clusters), size=count).astype(np.float64)


def effective_number(sizes: Reals) -> float:
    """The number of equally large clusters that would tell as much as these (Kish), of sizes of shape (n,)."""
    total = float(sizes.sum())
    return total * total / float((sizes * sizes).sum()) if total else 0.0


def interval_of(values: Reals, number: float) -> Interval:
    """The 95 % interval of resampled values.

    Args:
        values: Shape (n,); those that are not finite are left out.
        number: The effective number of clusters.
    """
    sound = values[np.isfinite(values)]
    if not len(sound) or number < CLUSTERS:
        return math.nan, math.nan
    wide = NormalDist().cdf(-student(LEVEL, number) * math.sqrt(number / (number - 1)))
    low, high = np.quantile(sound, (wide, 1 - wide))
    return float(low), float(high)


def student(level: float, clusters: float) -> float:
    """How many standard errors an interval reaches either way, by Student's distribution.

    It is expanded about the normal one: better than 1 % from 3 degrees of freedom on.
    """
    z = NormalDist().inv_cdf((1 + level) / 2)
    n = max(clusters - 1, 1.0)
    return (
        z
        + (z**3 + z) / (4 * n)
        + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * n**2)
        + (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / (384 * n**3)
    )


def wilson(rate: float, number: float, reach: float) -> Interval:
    """The interval of a share.

    Args:
        rate: The share.
        number: How many independent objects it is of.
        reach: Standard errors either way.
    """
    square = reach * reach / number
    middle = (rate + square / 2) / (1 + square)
    half = reach / (1 + square) * math.sqrt(rate * (1 - rate) / number + square / (4 * number))
    return max(0.0, middle - half), min(1.0, middle + half)


def ratio_interval(part: Reals, whole: Reals, objects: float = math.inf, level: float = LEVEL) -> Interval:
    """The interval of a share of objects in clusters; nan where clusters are too few.

    Args:
        part: How many there are in each cluster that count, shape (clusters,).
        whole: How many there are in all.
        objects: How many independent objects they can be at most.
        level: How often it holds the truth.
    """
    clusters, total = effective_number(whole), float(whole.sum())
    if clusters < CLUSTERS:
        return math.nan, math.nan
    rate = float(part.sum()) / total
    spread = float(np.square(part - rate * whole).sum()) / total**2 * clusters / (clusters - 1)
    # where nothing or everything counts, nothing tells how clusters differ: each is one object
    number = min(objects, rate * (1 - rate) / spread) if spread > 0 else clusters
    return wilson(rate, number, student(level, clusters))


def difference_interval(
    first: float, second: float, numbers: tuple[float, float], reach: float, correlation: float = 0.0
) -> Interval:
    """The interval of the first share less the second.

    Args:
        first: The first share.
        second: The other.
        numbers: How many independent objects each is of.
        reach: Standard errors either way.
        correlation: That of the two shares, where they are of the same objects.
    """
    low, high = wilson(first, numbers[0], reach)
    other_low, other_high = wilson(second, numbers[1], reach)

    def apart(one: float, other: float) -> float:
        return math.sqrt(max(0.0, one * one - 2 * correlation * one * other + other * other))

    return (
        first - second - apart(first - low, other_high - second),
        first - second + apart(high - first, second - other_low),
    )


def sign_flip_test(scores: Reals, rng: np.random.Generator, flips: int = FLIPS) -> float:
    """The probability that contributions of clusters add up to as much either way, were either sign as likely.

    Args:
        scores: By how much more objects in question than others each cluster misses, shape (clusters,).
        rng: Source of randomness, where there are too many clusters for all flips.
        flips: How many are drawn then.

    Returns:
        A p-value of two sides.
    """
    scores = scores[np.abs(scores) > 1e-12 * np.abs(scores).max(initial=0.0)]
    if not len(scores):
        return 1.0

    def studentised(signs: Reals) -> Reals:
        flipped = signs @ scores
        spread = np.maximum((scores * scores).sum() - flipped * flipped / len(scores), 0.0)
        with np.errstate(divide="ignore"):
            return np.abs(flipped) / np.sqrt(spread)

    found = studentised(np.ones((1, len(scores))))[0] * (1 - 1e-9)
    if len(scores) <= _ALL_FLIPS:
        # both signs of all at once come to the same
        numbers: NDArray[np.int64] = np.arange(2 ** (len(scores) - 1), dtype=np.int64)
        turned = np.bitwise_and(np.right_shift(numbers[:, None], np.arange(len(scores))), 1)
        return float(np.count_nonzero(studentised(1.0 - 2.0 * turned) >= found) / len(turned))
    above = 0
    for first in range(0, flips, _AT_ONCE):
        signs = rng.choice((-1.0, 1.0), size=(min(_AT_ONCE, flips - first), len(scores)))
        above += np.count_nonzero(studentised(signs) >= found)
    return float((1 + above) / (1 + flips))


def count_test(first: float, second: float, numbers: tuple[float, float]) -> float:
    """The probability that misses divide among two groups as unevenly by chance, given how many there are in all.

    Fisher's exact test at effective numbers, which are rounded; what is found counts half, as numbers are discrete.

    Args:
        first: The share missed of one group.
        second: That of the other.
        numbers: How many independent objects each is of.

    Returns:
        A p-value of two sides.
    """
    size, other = (max(1, round(number)) for number in numbers)
    own = min(size, round(first * size))
    missed = own + min(other, round(second * other))
    possible = np.arange(max(0, missed - other), min(size, missed) + 1)
    logs = np.array([_log_choose(size, k) + _log_choose(other, missed - k) for k in possible.tolist()])
    chances = np.exp(logs - logs.max())
    chances /= chances.sum()
    here = float(chances[possible == own].sum())
    below, above = float(chances[possible < own].sum()), float(chances[possible > own].sum())
    return min(1.0, 2 * (min(below, above) + here / 2))


def discordance_test(first: float, second: float) -> float:
    """The probability that objects which only one of two misses divide as unevenly by chance (McNemar).

    The exact test at effective numbers, which are rounded; what is found counts half, as numbers are discrete.

    Args:
        first: How many independent objects the first alone misses.
        second: How many the other alone does.

    Returns:
        A p-value of two sides.
    """
    own, other = round(first), round(second)
    chances = np.exp([_log_choose(own + other, k) - (own + other) * math.log(2) for k in range(own + other + 1)])
    here, below = float(chances[own]), float(chances[:own].sum())
    return min(1.0, 2 * (min(below, 1 - below - here) + here / 2))


def _log_choose(of: int, number: int) -> float:
    return math.lgamma(of + 1) - math.lgamma(number + 1) - math.lgamma(of - number + 1)


def holm(p_values: Reals) -> Reals:
    """P-values of several tests, corrected so that one false alarm among all of them is as rare as said (Holm).

    Args:
        p_values: Shape (n,); NaN stays NaN and does not count as a test.
    """
    found = np.full(len(p_values), np.nan)
    sound = np.flatnonzero(np.isfinite(p_values))
    order = sound[np.argsort(p_values[sound], kind="stable")]
    steps = p_values[order] * np.arange(len(order), 0, -1)
    found[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return found
