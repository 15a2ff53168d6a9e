"""Drawing one random variable, given the parameters of its distribution."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from statistics import NormalDist
from typing import assert_never, cast

from scenicq.forest.nodes import (
    DiscreteRange,
    Index,
    Leaf,
    Normal,
    PointIn,
    Range,
    TruncatedNormal,
    Undefined,
    Value,
    Vector,
)
from scenicq.geometry.regions import Region
from scenicq.geometry.sampling import sampler

__all__ = ["draw_leaf", "draw_point"]


def draw_point(region: Region) -> Callable[[random.Random], Vector | Undefined]:
    """What draws points of a region; `Undefined` where it is empty."""
    try:
        drawn = sampler(region)
    except ValueError as error:
        nothing = Undefined(f"a point of a region that is {error}")
        return lambda rng: nothing

    def draw(rng: random.Random) -> Vector | Undefined:
        try:
            return drawn(rng)
        except ValueError as error:
            return Undefined(f"a point of a region that is {error}")

    return draw


def draw_leaf(leaf: Leaf, args: tuple[Value, ...], rng: random.Random) -> Value:
    """A value of a random variable.

    Args:
        leaf: The random variable.
        args: The parameters of its distribution, in the order of `children`.
        rng: Source of randomness.
    """
    for arg in args:
        if isinstance(arg, Undefined):
            return arg
    numbers = cast("tuple[float, ...]", args)
    match leaf:
        case Range():
            return rng.uniform(*numbers)
        case Normal():
            return rng.gauss(*numbers)
        case TruncatedNormal():
            mean, deviation, low, high = numbers
            return _truncated(mean, deviation, low, high, rng.random())
        case DiscreteRange():
            low, high = math.ceil(numbers[0]), math.floor(numbers[1])
            return float(rng.randint(low, high)) if low <= high else Undefined("a range without an integer")
        case Index():
            return float(rng.choices(range(len(leaf.weights)), leaf.weights)[0])
        case PointIn():
            return draw_point(cast(Region, args[0]))(rng)
        case _:
            assert_never(leaf)


def _truncated(mean: float, deviation: float, low: float, high: float, share: float) -> Value:
    """The value of a truncated normal below which a share of its mass lies."""
    if low > high or deviation < 0:
        return Undefined("a truncated normal without an interval")
    if deviation == 0:
        return mean if low <= mean <= high else Undefined("a constant outside of its interval")
    # the lower tail keeps its precision: mirror what lies above the mean
    sign = -1.0 if low > mean else 1.0
    ends = sorted(sign * (end - mean) / deviation for end in (low, high))
    below, above = (math.erfc(-end / math.sqrt(2)) / 2 for end in ends)
    mass = below + share * (above - below)
    if not 0.0 < mass < 1.0:
        return Undefined("a truncated normal far outside of its interval")
    return min(max(mean + sign * deviation * NormalDist().inv_cdf(mass), low), high)
