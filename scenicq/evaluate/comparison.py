"""How often objects are missed: those in question against others that are alike, with what chance can do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scenicq.evaluate.resampling import (
    FEW,
    Interval,
    StratumCounts,
    effective_number,
    interval_of,
    rate_interval,
    rates,
    sign_flip_test,
)

__all__ = [
    "DISTANCES_M",
    "ObjectComparison",
    "Share",
    "compare",
    "distance_names",
    "p_text",
    "percent",
    "share_of",
    "strata_of",
]

Reals = NDArray[np.float64]
Numbers = NDArray[np.int64]
Bools = NDArray[np.bool_]

DISTANCES_M = (10.0, 20.0, 30.0, 50.0)
"""Ends of the classes of distance from the ego."""


@dataclass(frozen=True, slots=True)
class Share:
    """A share of objects that were missed.

    Attributes:
        missed, of: How many; weighted, where the others are spread as the group is.
        rate: The share; nan without objects.
        interval: Of 95 %.
    """

    missed: float
    of: float
    rate: float
    interval: Interval


@dataclass(frozen=True, slots=True)
class ObjectComparison:
    """Objects in question against others.

    Attributes:
        about: What is compared, such as "role parkedCar".
        share: Of the objects in question.
        other: Of the others, spread over distance and visibility as the objects in question are.
        difference: Of the two rates.
        interval: Of the difference.
        p_value: Of the test that objects of both groups are missed alike.
        recordings: With an object in question.
        effective: Number of equally large recordings that would tell as much.
        alone: Share of the objects in question to which no other is alike.
        p_corrected: The same p-value, corrected for all tests of the evaluation.
        uncounted: How many more objects would be in question, but for the rules of the benchmark.
    """

    about: str
    share: Share
    other: Share
    difference: float
    interval: Interval
    p_value: float
    recordings: int
    effective: float
    alone: float = 0.0
    p_corrected: float = math.nan
    uncounted: int = 0

    @property
    def few(self) -> bool:
        """Whether there are too few recordings for a verdict."""
        return self.effective < FEW

    @property
    def sentence(self) -> str:
        """All of it in one line."""
        if math.isnan(self.share.rate):
            without = f"none of {self.uncounted} objects counts" if self.uncounted else "no object to be found"
            return f"{self.about}: {without}"
        text = f"missed {percent(self.share)} of {self.about}"
        if not math.isnan(self.other.rate):
            text += f" against {percent(self.other)}"
        if not math.isnan(self.p_value):
            text += f"; {p_text(self.p_value)}"
            if not math.isnan(self.p_corrected) and self.p_corrected != self.p_value:
                text += f" (corrected {p_text(self.p_corrected)})"
        text += f" over {self.recordings} recording{'s' if self.recordings != 1 else ''}"
        return text + (": too few for a verdict" if self.few else "")


def p_text(value: float) -> str:
    """A p-value as it stands in a sentence."""
    return "p < 0.001" if value < 0.001 else f"p = {value:.3f}"


def percent(share: Share) -> str:
    """A share with its interval, as it stands in a sentence."""
    if math.isnan(share.interval[0]):
        return f"{100 * share.rate:.0f} %"
    low, high = share.interval
    return f"{100 * share.rate:.0f} % [{100 * low:.0f}, {100 * high:.0f}]"


def distance_names() -> tuple[str, ...]:
    """Names of the classes of distance."""
    ends = [f"{end:g}" for end in DISTANCES_M]
    return (
        f"up to {ends[0]} m",
        *(f"{low} to {high} m" for low, high in pairwise(ends)),
        f"over {ends[-1]} m",
    )


def _table(values: Reals, recording: Numbers, stratum: Numbers, shape: tuple[int, int]) -> Reals:
    """Sums by recording and stratum."""
    sums = np.bincount(recording * shape[1] + stratum, weights=values, minlength=shape[0] * shape[1])
    return sums.astype(np.float64).reshape(shape)


def compare(
    about: str,
    missed: Bools,
    mine: Bools,
    others: Bools,
    recording: Numbers,
    stratum: Numbers,
    weights: Reals,
    rng: np.random.Generator,
) -> ObjectComparison:
    """Compare two groups of objects.

    Args:
        about: What is compared.
        missed: Whether each object was missed, shape (n,).
        mine: The objects in question, shape (n,).
        others: Those that they are compared with, shape (n,).
        recording: Number of each object's recording, shape (n,).
        stratum: Number of each object's stratum; objects of one are alike.
        weights: How often each recording counts in each resample, shape (resamples, recordings).
        rng: Source of randomness of the test.
    """
    strata = int(stratum.max()) + 1 if len(stratum) else 1
    shape = (weights.shape[1], strata)

    def table(values: Bools) -> Reals:
        return _table(values.astype(np.float64), recording, stratum, shape)

    counts = StratumCounts(table(missed & mine), table(mine), table(missed & others), table(others))
    used = (counts.of.sum(axis=0) > 0) | (counts.other_of.sum(axis=0) > 0)
    counts = StratumCounts(
        counts.missed[:, used], counts.of[:, used], counts.other_missed[:, used], counts.other_of[:, used]
    )
    first, second = (float(values[0]) for values in rates(counts, np.ones((1, shape[0]))))
    many, many_others = rates(counts, weights)
    effective = effective_number(counts.of.sum(axis=1))
    comparable = counts.comparable
    of_others = counts.other_of[:, comparable]
    # the number of the others, were they spread as the group is
    spread = counts.of[:, comparable].sum(axis=0) / np.maximum(of_others.sum(axis=0), 1)
    effective_others = effective_number((of_others * spread).sum(axis=1))
    total = float(counts.of.sum())
    alike = float(counts.of[:, comparable].sum())
    both = min(effective, effective_others) if alike else 0.0
    return ObjectComparison(
        about=about,
        share=Share(float(counts.missed.sum()), total, first, rate_interval(many, first, effective)),
        other=Share(
            float(counts.other_missed[:, comparable].sum()),
            float(of_others.sum()),
            second,
            rate_interval(many_others, second, effective_others),
        ),
        difference=first - second,
        interval=interval_of(many - many_others, both),
        p_value=sign_flip_test(counts, rng) if alike else math.nan,
        recordings=int((counts.of.sum(axis=1) > 0).sum()),
        effective=effective,
        alone=1 - alike / total if total else 0.0,
    )


def share_of(missed: Bools, mine: Bools, recording: Numbers, weights: Reals) -> Share:
    """The share missed of one group; arguments as of `compare`."""
    shape = (weights.shape[1], 1)
    zero = np.zeros(len(recording), dtype=np.int64)
    of = _table(mine.astype(np.float64), recording, zero, shape)[:, 0]
    lost = _table((missed & mine).astype(np.float64), recording, zero, shape)[:, 0]
    total = float(of.sum())
    rate = float(lost.sum()) / total if total else math.nan
    with np.errstate(invalid="ignore", divide="ignore"):
        resampled = (weights @ lost) / (weights @ of)
    return Share(float(lost.sum()), total, rate, rate_interval(resampled, rate, effective_number(of)))


def strata_of(columns: Sequence[Numbers]) -> Numbers:
    """The number of each object's stratum: objects are alike if they are in every column."""
    if not columns:
        return np.zeros(0, dtype=np.int64)
    found = np.zeros(len(columns[0]), dtype=np.int64)
    for column in columns:
        _, found = np.unique(found * (int(column.max(initial=0)) + 1) + column, return_inverse=True)
    return found
