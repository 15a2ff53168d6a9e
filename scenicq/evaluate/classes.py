"""Recall, precision, average precision and errors of each class, on frames that match and on the others."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.evaluate.detection import ERRORS_AT_M, Detection
from scenicq.evaluate.precision import ERRORS, average_precision, mean_errors, resampled_errors
from scenicq.evaluate.resampling import Interval, effective_number, interval_of, ratio_interval, sums_by

__all__ = ["ClassFigures", "class_figures"]

Reals = NDArray[np.float64]
Bools = NDArray[np.bool_]

_BINS = 100
"""Classes of scores, of equal numbers of boxes, in which resamples are computed."""
_RESAMPLES = 500

Figure = tuple[float, Interval]
"""A number with its interval of 95 %."""


@dataclass(frozen=True, slots=True)
class ClassFigures:
    """The figures of one class at one centre distance.

    Attributes:
        category: The class.
        group: "matching" or "other".
        distance_m: The centre distance.
        objects, predictions: How many there are, predictions of the least score asked for only.
        recordings: Effective number of clusters.
        recall, precision: Those of the predictions that have the least score asked for.
        average_precision: Over all scores.
        errors: By name, at `ERRORS_AT_M` only.
    """

    category: str
    group: str
    distance_m: float
    objects: int
    predictions: int
    recordings: float
    recall: Figure
    precision: Figure
    average_precision: Figure
    errors: dict[str, Figure]


def class_figures(
    detection: Detection, group: str, frames: Bools, cluster: NDArray[np.int64], weights: Reals, least: float
) -> Iterator[ClassFigures]:
    """The figures of each class that has label objects.

    Args:
        detection: Labels and predictions.
        group: What the frames are called.
        frames: Which frames count, shape (frames,).
        cluster: Number of each frame's cluster, shape (frames,).
        weights: How often each cluster counts in each resample, shape (resamples, clusters).
        least: Score from which predictions count for recall and precision.
    """
    weights = weights[:_RESAMPLES]
    for number, category in enumerate(detection.classes):
        objects = np.flatnonzero((detection.object_class == number) & frames[detection.objects.frame])
        if len(objects):
            mine = np.flatnonzero((detection.prediction_class == number) & frames[detection.frame])
            one = _OneClass(detection, category, group, objects, mine, cluster, weights, least)
            yield from (one.figures(distance) for distance in detection.owner)


class _OneClass:
    """Label objects and predictions of one class, counted by cluster."""

    def __init__(
        self, detection: Detection, category: str, group: str, objects: NDArray[np.int64], mine: NDArray[np.int64],
        cluster: NDArray[np.int64], weights: Reals, least: float,
    ) -> None:  # fmt: skip
        self._detection, self._category, self._group = detection, category, group
        self._objects, self._mine, self._weights = objects, mine, weights
        self._of_objects = cluster[detection.objects.frame[objects]]
        self._of_mine = cluster[detection.frame[mine]]
        self._clusters = weights.shape[1]
        self._clipped = detection.predictions.protocol.clipped
        self._least = least
        self._high = detection.predictions.score[mine] >= least
        self._per = sums_by(self._of_objects, np.ones(len(objects)), self._clusters)
        self._number = effective_number(self._per)
        self._bin = np.arange(len(mine)) * _BINS // max(len(mine), 1)

    def _by_cluster(self, which: Bools) -> Reals:
        return sums_by(self._of_mine, which, self._clusters)

    def _binned(self, values: Reals) -> Reals:
        """Sums up to each class of scores in each resample, shape (resamples, bins)."""
        places = self._of_mine * _BINS + self._bin
        table = np.bincount(places, weights=values, minlength=self._clusters * _BINS)
        return np.cumsum(self._weights @ table.reshape(-1, _BINS), axis=1)

    def figures(self, distance: float) -> ClassFigures:
        """The figures at a centre distance."""
        detection = self._detection
        found = detection.owner[distance][self._mine] >= 0
        hit = detection.score[distance][self._objects] >= self._least
        hits = sums_by(self._of_objects, hit, self._clusters)
        right, all_high = self._by_cluster(found & self._high), self._by_cluster(self._high)
        objects = np.array([float(len(self._objects))])
        exact = average_precision(
            np.cumsum(found, dtype=np.float64)[None], np.cumsum(~found, dtype=np.float64)[None], objects,
            clipped=self._clipped,
        )  # fmt: skip
        resampled = self._weights @ self._per
        founds = self._binned(found.astype(np.float64))
        precisions = average_precision(
            founds, self._binned((~found).astype(np.float64)), resampled, clipped=self._clipped
        )
        errors: dict[str, Figure] = {}
        if distance == ERRORS_AT_M:
            errors = self._errors(found, founds, resampled)
        return ClassFigures(
            category=self._category,
            group=self._group,
            distance_m=distance,
            objects=len(self._objects),
            predictions=int(self._high.sum()),
            recordings=self._number,
            recall=self._ratio(hits, self._per),
            precision=self._ratio(right, all_high),
            average_precision=(float(exact[0]), _inside(interval_of(precisions, self._number))),
            errors=errors,
        )

    def _ratio(self, part: Reals, whole: Reals) -> Figure:
        total = float(whole.sum())
        rate = float(part.sum()) / total if total else math.nan
        return rate, ratio_interval(part, whole, total)

    def _errors(self, found: Bools, founds: Reals, objects: Reals) -> dict[str, Figure]:
        detection, protocol = self._detection, self._detection.predictions.protocol
        errors = detection.errors[self._mine]
        score = detection.predictions.score[self._mine]
        means = mean_errors(score, found, errors[found], len(self._objects), clipped=self._clipped)
        told: dict[str, Figure] = {}
        for place, name in enumerate(ERRORS):
            values = errors[:, place]
            known = found & ~np.isnan(values)
            if not known.any() or not protocol.has_error(name, self._category):
                continue
            sums, counts = self._binned(np.where(known, values, 0.0)), self._binned(known.astype(np.float64))
            many = resampled_errors(sums, counts, founds, objects, clipped=self._clipped)
            told[name] = float(means[place]), interval_of(many, self._number)
        return told


def _inside(interval: Interval) -> Interval:
    return max(0.0, interval[0]), min(1.0, interval[1])
