"""Weight frames that match so that they spread as the program spreads its scenes.

The frames of a dataset that match are not spread as the program would draw them: some gaps, some roads are more
frequent on the way. A frame counts by the density with which the program generates its values of random variables, over
that with which the dataset has them (importance sampling). The second is estimated from the other frames, by a kernel
density estimate with reflection at the ends of what is seen (Silverman 1986, sections 2.10 and 4.5) that leaves the
frame itself out: else what a dataset has hardly ever would count too little, the more so the more variables there are
(Delyon and Portier 2016, "Integral approximation by kernel smoothing"). A frame without neighbours counts much, which
the number of equally weighted objects tells.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.evaluate.comparison import Share, percent
from scenicq.evaluate.resampling import CLUSTERS, effective_number, ratio_interval, sums_by

__all__ = ["WeightedShare", "log_weights", "weigh"]

Reals = NDArray[np.float64]
Bools = NDArray[np.bool_]

_MOST = 2000
"""Frames of which the estimate is made, at most."""
_CHUNK = 500
_LEAST = 0.1
"""What the kernels of all other frames come to at least, a frame at the same place being 1: bounds the weights."""


def log_weights(log_density: Reals, values: Reals, finite: Sequence[Hashable], seed: int = 0) -> Reals:
    """Logarithms of the weights of frames, which are 1 in the mean; shape (n,).

    Args:
        log_density: The program's log-density at the values of each frame, up to a constant, shape (n,); finite.
        values: Those of the continuous random variables, shape (n, variables).
        finite: What the frame has of features without a density; frames count as neighbours where it is the same.
        seed: Chooses the frames that the estimate is made of, where there are many.
    """
    count = len(log_density)
    if not count:
        return np.zeros(0)
    kinds: dict[Hashable, int] = {}
    kind = np.array([kinds.setdefault(each, len(kinds)) for each in finite])
    spread = values.std(axis=0)
    points = values[:, spread > 0] / spread[spread > 0]
    chosen = np.arange(count)
    if count > _MOST:
        chosen = np.random.default_rng(seed).choice(count, _MOST, replace=False)
    dimension = points.shape[1]
    # Silverman's rule for a normal kernel
    width = (4 / (dimension + 2) / len(chosen)) ** (1 / (dimension + 4))
    low, high = (points.min(axis=0), points.max(axis=0)) if dimension else (points, points)
    found = np.empty(count)
    for start in range(0, count, _CHUNK):
        mine = slice(start, start + _CHUNK)
        alike = kind[mine, None] == kind[None, chosen]
        others = alike & (np.arange(count)[mine, None] != chosen)
        near = others.astype(np.float64)
        for axis in range(dimension):
            one, other = points[mine, None, axis], points[None, chosen, axis]
            away = (one - other, one + other - 2 * low[axis], one + other - 2 * high[axis])
            near *= sum(np.exp(-np.square(each) / (2 * width * width)) for each in away)
        # as if the frame itself were as near to all others as they are in the mean; alone of its kind it is one
        number = others.sum(axis=1)
        near_all = np.maximum(near.sum(axis=1), _LEAST) * alike.sum(axis=1) / np.maximum(number, 1)
        found[mine] = log_density[mine] - np.log(np.where(number > 0, near_all, 1.0))
    return found - found.max() - math.log(float(np.exp(found - found.max()).mean()))


@dataclass(frozen=True, slots=True)
class WeightedShare:
    """The share of objects missed, were frames spread as the program spreads its scenes.

    Attributes:
        about: Which objects, such as "role parkedCar".
        share: How often they are missed; its counts are sums of weights, which are 1 in the mean.
        objects: How many have a weight.
        left_out: How many have none: the program has no density there.
        equal: How many objects of one weight would tell as much (Kish).
        recordings: How many equally large recordings would tell as much.
    """

    about: str
    share: Share
    objects: int
    left_out: int
    equal: float
    recordings: float

    @property
    def sentence(self) -> str:
        """All of it in one line."""
        if not self.objects:
            return f"{self.about} as the program spreads it: no density is known"
        text = f"missed {percent(self.share)} of {self.about} as the program spreads it"
        text += f"; {self.objects} objects tell as much as {self.equal:.0f} of one weight"
        if self.left_out:
            text += f", {self.left_out} without a density are left out"
        return text + (": too few recordings for a verdict" if self.recordings < CLUSTERS else "")


def weigh(about: str, missed: Bools, log_weight: Reals, cluster: NDArray[np.int64]) -> WeightedShare:
    """Work out the weighted share of objects that was missed.

    Args:
        about: Which objects.
        missed: Whether each was missed, shape (n,).
        log_weight: Logarithm of the weight of each, nan without, shape (n,).
        cluster: Number of the cluster of each, shape (n,).
    """
    known = ~np.isnan(log_weight)
    missed, cluster, weight = missed[known], cluster[known], np.exp(log_weight[known])
    of, lost = sums_by(cluster, weight), sums_by(cluster, weight * missed)
    total, number, equal = float(of.sum()), effective_number(of), effective_number(weight)
    rate = float(lost.sum()) / total if total else math.nan
    share = Share(float(lost.sum()), total, rate, ratio_interval(lost, of, equal), number)
    return WeightedShare(about, share, len(weight), int((~known).sum()), equal, number)
