"""Invented models with a known rate of failure, recording by recording."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from scenicq.evaluate.resampling import (
    StratumCounts,
    effective_number,
    interval_of,
    rate_interval,
    rates,
    resamples,
    sign_flip_test,
)


def world(rng: np.random.Generator, recordings: int, base: float, more: float, spread: float = 0.5) -> StratumCounts:
    """Objects of recordings whose rates differ from each other, missed at a rate that is `more` in the group."""

    def rate(mean: float, shift: float) -> float:
        return 1 / (1 + math.exp(-(math.log(mean / (1 - mean)) + shift)))

    rows = []
    for _ in range(recordings):
        shift = rng.normal(0, spread)
        mine = int(rng.integers(3, 15)) if rng.random() < 0.7 else 0
        others = int(rng.integers(40, 90))
        missed = rng.binomial(mine, rate(base + more, shift + rng.normal(0, spread / 2)))
        rows.append((missed, mine, rng.binomial(others, rate(base, shift)), others))
    columns = np.array(rows, dtype=np.float64).T
    return StratumCounts(*(column[:, None] for column in columns))


def layered(rng: np.random.Generator, recordings: int, base: float, more: float, spread: float = 0.5) -> StratumCounts:
    """The same with three strata, in the second and third of which more is missed, and a group spread otherwise."""

    def rate(mean: np.ndarray, shift: np.ndarray) -> np.ndarray:
        return 1 / (1 + np.exp(-(np.log(mean / (1 - mean)) + shift)))

    bases, shape = base * np.array([0.7, 1.7, 3.0]), (recordings, 3)
    mine = rng.integers(0, 8, shape) * (rng.random((recordings, 1)) < 0.75)
    others = rng.integers(5, 40, shape) // np.array([1, 2, 4])
    shift = rng.normal(0, spread, (recordings, 1))
    missed = rng.binomial(mine, rate(bases + more, shift + rng.normal(0, spread / 2, (recordings, 1))))
    counts = (missed, mine, rng.binomial(others, rate(bases, shift)), others)
    return StratumCounts(*(each.astype(np.float64) for each in counts))


World = Callable[[np.random.Generator, int, float, float], StratumCounts]


def truth(base: float, more: float, make: World) -> tuple[float, float]:
    """The rates of both groups over very many recordings."""
    counts = make(np.random.default_rng(1), 20_000, base, more)
    return tuple(float(values[0]) for values in rates(counts, np.ones((1, 20_000))))  # type: ignore[return-value]


def planted(
    count: int, recordings: int, base: float, more: float, draws: int, flips: int, make: World = world
) -> tuple[float, float, float]:
    """Shares of datasets in which the interval of the rate, and that of the difference, hold the truth; of alarms."""
    first, second = truth(base, more, make)
    held = differences = alarms = 0
    for seed in range(count):
        rng = np.random.default_rng(1000 + seed)
        counts = make(rng, recordings, base, more)
        weights = resamples(recordings, rng, draws)
        many, others = rates(counts, weights)
        one, _ = rates(counts, np.ones((1, recordings)))
        number = effective_number(counts.of.sum(axis=1))
        low, high = rate_interval(many, float(one[0]), number)
        held += low <= first <= high
        spread = counts.of.sum(axis=0) / counts.other_of.sum(axis=0)
        number = min(number, effective_number((counts.other_of * spread).sum(axis=1)))
        low, high = interval_of(many - others, number)
        differences += low <= first - second <= high
        alarms += sign_flip_test(counts, rng, flips) <= 0.05
    return held / count, differences / count, alarms / count
