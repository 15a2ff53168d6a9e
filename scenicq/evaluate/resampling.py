"""What chance can do: frames of one recording resemble each other, so recordings are resampled, never frames.

Intervals are percentiles of the bootstrap over recordings, moved outward for few recordings as Student's distribution
is (Hesterberg 2015, "What teachers should know about the bootstrap", section 5.3). Differences are tested by flipping
the signs of the recordings' contributions (Hemerik, Goeman and Finos 2020, "Robust testing in generalized linear models
by sign flipping score contributions").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "FEW",
    "Interval",
    "StratumCounts",
    "effective_number",
    "holm",
    "interval_of",
    "rate_interval",
    "rates",
    "resamples",
    "sign_flip_test",
]

Reals = NDArray[np.float64]
Interval = tuple[float, float]

RESAMPLES = 2000
FLIPS = 4999
FEW = 8.0
"""Below this effective number of recordings intervals and tests are told to be rough."""
_AT_ONCE = 250
"""Flips of all recordings that are drawn at once."""
_LEVEL = 0.95


@dataclass(frozen=True, slots=True, eq=False)
class StratumCounts:
    """Objects in two groups, by recording and stratum (objects that are alike in distance and visibility).

    Attributes:
        missed, of: Objects of the group in question that were missed, and all of them; shape (recordings, strata).
        other_missed, other_of: The same for those that it is compared with.
    """

    missed: Reals
    of: Reals
    other_missed: Reals
    other_of: Reals

    @property
    def comparable(self) -> NDArray[np.bool_]:
        """Strata in which there are objects of both groups, shape (strata,)."""
        return (self.of.sum(axis=0) > 0) & (self.other_of.sum(axis=0) > 0)


def resamples(recordings: int, rng: np.random.Generator, count: int = RESAMPLES) -> Reals:
    """How often each recording is drawn in each resample, shape (count, recordings)."""
    if recordings == 0:
        return np.zeros((count, 0))
    return rng.multinomial(recordings, np.full(recordings, 1.0 / recordings), size=count).astype(np.float64)


def rates(counts: StratumCounts, weights: Reals) -> tuple[Reals, Reals]:
    """The share missed in the group, and among the others if they were spread over the strata as the group is.

    Args:
        counts: The objects.
        weights: How often each recording counts, shape (n, recordings).

    Returns:
        Two arrays of shape (n,); NaN where a group has no objects.
    """
    of, missed = weights @ counts.of, weights @ counts.missed
    other_of, other_missed = weights @ counts.other_of, weights @ counts.other_missed
    with np.errstate(invalid="ignore", divide="ignore"):
        first = missed.sum(axis=1) / of.sum(axis=1)
        both = (of > 0) & (other_of > 0)
        shares = np.where(both, of, 0.0)
        of_others = np.where(both, other_missed / other_of, 0.0)
        second = (shares * of_others).sum(axis=1) / shares.sum(axis=1)
    return first, second


def effective_number(sizes: Reals) -> float:
    """The number of equally large recordings that would tell as much as these (Kish), of sizes of shape (n,)."""
    total = float(sizes.sum())
    return total * total / float((sizes * sizes).sum()) if total else 0.0


def interval_of(values: Reals, number: float) -> Interval:
    """The 95 % interval of resampled values.

    Args:
        values: Shape (n,); those that are not finite are left out.
        number: The effective number of recordings.
    """
    sound = values[np.isfinite(values)]
    if not len(sound) or number < 2:
        return math.nan, math.nan
    tail = (1 - _LEVEL) / 2
    wide = NormalDist().cdf(-_student(1 - tail, number - 1) * math.sqrt(number / (number - 1)))
    low, high = np.quantile(sound, (wide, 1 - wide))
    return float(low), float(high)


def rate_interval(values: Reals, rate: float, number: float) -> Interval:
    """The same for a share: where nothing or everything was missed, resamples say nothing, and the binomial does."""
    if math.isnan(rate) or number < 1:
        return math.nan, math.nan
    if rate in (0.0, 1.0):
        reach = 1 - ((1 - _LEVEL) / 2) ** (1 / number)
        return (0.0, reach) if rate == 0.0 else (1 - reach, 1.0)
    low, high = interval_of(values, number)
    return max(0.0, low), min(1.0, high)


def _student(share: float, freedom: float) -> float:
    """The quantile of Student's distribution, by its expansion about the normal one; better than 1 % from 3 on."""
    z = NormalDist().inv_cdf(share)
    n = max(freedom, 1.0)
    return (
        z
        + (z**3 + z) / (4 * n)
        + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * n**2)
        + (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / (384 * n**3)
    )


def sign_flip_test(counts: StratumCounts, rng: np.random.Generator, flips: int = FLIPS) -> float:
    """The probability of a difference as large as this one, were objects of both groups missed alike.

    Each recording contributes by how many more objects of the group than of the others it misses than the common rate
    of the stratum says; without a difference, either sign of a contribution is as likely.

    Returns:
        A p-value of two sides; NaN where nothing can be compared.
    """
    use = counts.comparable
    if not use.any():
        return math.nan
    of, missed = counts.of[:, use], counts.missed[:, use]
    other_of, other_missed = counts.other_of[:, use], counts.other_missed[:, use]
    common = (missed + other_missed).sum(axis=0) / (of + other_of).sum(axis=0)
    share = of.sum(axis=0) / other_of.sum(axis=0)
    scores = ((missed - common * of) - share * (other_missed - common * other_of)).sum(axis=1)
    scores = scores[scores != 0]
    if not len(scores):
        return 1.0

    def studentised(signs: Reals) -> Reals:
        flipped = signs @ scores
        spread = np.maximum((scores * scores).sum() - flipped * flipped / len(scores), 0.0)
        with np.errstate(divide="ignore"):
            return np.abs(flipped) / np.sqrt(spread)

    found = studentised(np.ones((1, len(scores))))[0]
    above = 0
    for first in range(0, flips, _AT_ONCE):
        signs = rng.choice((-1.0, 1.0), size=(min(_AT_ONCE, flips - first), len(scores)))
        above += np.count_nonzero(studentised(signs) >= found * (1 - 1e-12))
    return float((1 + above) / (1 + flips))


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
