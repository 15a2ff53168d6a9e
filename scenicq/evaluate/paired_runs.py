"""Recordings beside the simulated runs that rebuild them, and what simulation adds where recordings are few.

Simulation is a control variate: how much of what differs between recordings it foretells is known from the pairs, and
how often it fails over all scenes that were simulated is known better than over the few that were recorded (the
regression estimator of double sampling, Cochran 1977, "Sampling Techniques", section 12.6).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.evaluate.comparison import Share, format_points, percent, plural
from scenicq.evaluate.resampling import CLUSTERS, LEVEL, Interval, means_by, student, sums_by

__all__ = ["PairedRuns", "pair_runs"]

Reals = NDArray[np.float64]
Numbers = NDArray[np.int64]
Bools = NDArray[np.bool_]

_UNKNOWN: Interval = (math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class PairedRuns:
    """Recordings, or clusters of them, beside the runs that rebuild them.

    Attributes:
        pairs: How many clusters there are that runs rebuild.
        without: Clusters with objects in question that no run rebuilds.
        real: What is missed in those that have runs.
        simulated: What fails in their runs, each cluster as heavy as its objects in question.
        difference: The first less the second.
        interval: That of the difference.
        explained: The share of what differs between clusters that runs explain, corrected for chance (adjusted R
            squared); nan where nothing differs, or there are fewer than five pairs.
        adjusted: The rate with simulation as a control variate, and its interval; nan where it is left out.
        unit: What clusters are.
    """

    pairs: int
    without: int
    real: Share
    simulated: float
    difference: float
    interval: Interval
    explained: float
    adjusted: tuple[float, Interval]
    unit: str

    @property
    def sentence(self) -> str:
        """All of it in words."""
        units = f"{self.pairs} {plural(self.unit, self.pairs)}"
        text = f"in {units} that runs rebuild {percent(self.real)} are missed and {100 * self.simulated:.0f} % failed"
        if not math.isnan(self.interval[0]):
            text += f" ({format_points(self.difference, self.interval, ' points')})"
        if math.isnan(self.explained):
            return text
        if self.explained <= 0:
            return f"{text}; simulation explains nothing of how {self.unit}s differ, and nothing is taken from it"
        text += f"; simulation explains {100 * self.explained:.0f} % of how {self.unit}s differ"
        rate, interval = self.adjusted
        if math.isnan(rate):
            return text
        missed = percent(Share(math.nan, math.nan, rate, interval))
        return f"{text}: with it as a control variate {missed} are missed"


def pair_runs(
    failed: Reals, rebuilt: Numbers, scene: Numbers, missed: Bools, cluster: Numbers, unit: str
) -> PairedRuns | None:
    """Set recordings beside the runs that rebuild them; None where no run rebuilds one with an object in question.

    Args:
        failed: What failed in each run, 0 to 1, shape (runs,).
        rebuilt: The cluster of the recording that each run rebuilds, -1 for none, shape (runs,).
        scene: Number of the scene that each run is of: runs of one scene count as one, shape (runs,).
        missed: Whether each object in question was missed, shape (objects,).
        cluster: The cluster of each, shape (objects,).
        unit: What clusters are.
    """
    count = int(max(cluster.max(initial=-1), rebuilt.max(initial=-1))) + 1
    of = sums_by(cluster, np.ones(len(cluster)), count)
    runs, ones = rebuilt >= 0, np.ones(len(failed))
    there = np.flatnonzero((of > 0) & (sums_by(rebuilt[runs], ones[runs], count) > 0))
    if not len(there):
        return None
    each = np.zeros(count)
    each[rebuilt[runs]] = means_by(rebuilt[runs], failed[runs], ones[runs])
    weight = of[there] / of[there].sum()
    real, simulated = sums_by(cluster, missed, count)[there] / of[there], each[there]
    rate, mean = float(weight @ real), float(weight @ simulated)
    apart = rate - mean
    number = len(there)
    without = int((of > 0).sum()) - number
    interval = _interval(apart, weight * (real - simulated - apart), 1, 0.0, (-1.0, 1.0))
    lost, plain = weight * (real - rate), _interval(rate, weight * (real - rate), 1, 0.0, (0.0, 1.0))
    share = Share(float(real @ of[there]), float(of[there].sum()), rate, plain, float(number))
    explained, adjusted = math.nan, (math.nan, _UNKNOWN)
    if number >= CLUSTERS and lost.any():
        turned = weight * (simulated - mean)
        slope = float(turned @ lost) / float(turned @ turned) if turned.any() else 0.0
        rest = lost - slope * turned
        explained = 1 - float(rest @ rest) / float(lost @ lost) * (number - 1) / (number - 2)
        scenes = _scenes(failed, scene)
        # where nothing but what was recorded was simulated, there is nothing to learn from
        if explained > 0 and not without and len(scenes) > number:
            off = mean - float(scenes.mean())
            # what is not known of the slope, and of how often simulation fails
            more = off**2 * float(rest @ rest) / (number - 2) / float(turned @ turned)
            more += slope**2 * float(scenes.var(ddof=1)) / len(scenes)
            adjusted = rate - slope * off, _interval(rate - slope * off, rest, 2, more, (0.0, 1.0))
    return PairedRuns(number, without, share, mean, apart, interval, explained, adjusted, unit)


def _scenes(failed: Reals, scene: Numbers) -> Reals:
    """What failed in each scene."""
    _, first, number = np.unique(scene, return_index=True, return_inverse=True)
    return means_by(number, failed, np.ones(len(failed)))[first]


def _interval(middle: float, parts: Reals, fitted: int, more: float, ends: Interval) -> Interval:
    """The interval of a mean over clusters, by Student's distribution.

    Args:
        middle: The mean.
        parts: By how much each cluster departs from it, weighted, shape (n,).
        fitted: How many numbers were fitted.
        more: Variance that comes from elsewhere.
        ends: Where it ends at most.
    """
    free = len(parts) - fitted
    if len(parts) < CLUSTERS or free < 1:
        return _UNKNOWN
    spread = float(parts @ parts) * len(parts) / free + more
    reach = student(LEVEL, free + 1) * math.sqrt(spread)
    return max(ends[0], middle - reach), min(ends[1], middle + reach)
