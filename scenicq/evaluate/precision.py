"""Average precision and the errors of what was found, as the benchmarks of nuScenes and Argoverse 2 define them.

Everything is computed from counts in the order of falling scores: box by box, which gives the benchmarks' own numbers,
or in classes of scores with a weight for each recording, which gives their resamples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["ERRORS", "Errors", "average_precision", "box_errors", "mean_errors", "resampled_errors"]

Reals = NDArray[np.float64]

ERRORS = ("translation", "scale", "orientation", "velocity", "attribute")
"""Metres; 1 - intersection over union of aligned boxes; radians; metres per second; share of wrong attributes."""

_NEAREST = 0.1
"""Precision and recall up to this do not count in the clipped definition."""
_SAMPLES = 101
_TINY = 2.2204460492503131e-16


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """Two boxes each, label and prediction: what is compared. Arrays have shape (n,).

    Attributes:
        dx, dy, dz: Difference of the centres, metres.
        sizes, other_sizes: Width, length and height of both, shape (n, 3); a height of nan is left out of the volume.
        turn: Difference of the headings, radians.
        dvx, dvy: Difference of the velocities, metres per second.
        attribute: 1 where the attribute is another, 0 where it is the same, nan where the label has none.
    """

    dx: Reals
    dy: Reals
    sizes: Reals
    other_sizes: Reals
    turn: Reals
    dvx: Reals
    dvy: Reals
    dz: Reals
    attribute: Reals


def box_errors(pairs: Errors, half_turn: NDArray[np.bool_], *, hull: bool = False) -> Reals:
    """The errors of `ERRORS`, shape (n, 5); nan where something is unknown.

    Args:
        pairs: What is compared.
        half_turn: For which pairs both directions of the box are the same, shape (n,).
        hull: Whether the box around both aligned boxes is taken for their union.
    """
    unknown = np.isnan(pairs.sizes) | np.isnan(pairs.other_sizes)
    flat = unknown[:, 2]
    sizes, others = pairs.sizes.copy(), pairs.other_sizes.copy()
    sizes[flat, 2] = others[flat, 2] = 1.0
    common = np.minimum(sizes, others).prod(axis=1)
    union = np.maximum(sizes, others).prod(axis=1) if hull else sizes.prod(axis=1) + others.prod(axis=1) - common
    scale = 1 - common / union
    period = np.where(half_turn, math.pi, math.tau)
    turn = np.abs((pairs.turn + period / 2) % period - period / 2)
    away = np.hypot(np.hypot(pairs.dx, pairs.dy), pairs.dz)
    return np.column_stack((away, scale, turn, np.hypot(pairs.dvx, pairs.dvy), pairs.attribute))


def average_precision(found: Reals, wrong: Reals, objects: Reals, *, clipped: bool) -> Reals:
    """Average precision, shape (b,).

    Args:
        found: How many predictions up to each place are label objects, in the order of falling scores; shape (b, n).
        wrong: How many are not.
        objects: How many label objects there are, shape (b,).
        clipped: See `Protocol`.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        precision = found / (found + wrong) if clipped else found / (found + wrong + _TINY)
        recall = found / objects[:, None]
    precision = np.nan_to_num(precision)
    if not clipped:
        precision = np.maximum.accumulate(precision[:, ::-1], axis=1)[:, ::-1]
    if not found.shape[1]:
        return np.where(objects > 0, 0.0, math.nan)
    values = _interpolated(np.linspace(0, 1, _SAMPLES), recall, precision)
    if clipped:
        values = np.maximum(values[:, round(100 * _NEAREST) + 1 :] - _NEAREST, 0) / (1 - _NEAREST)
    return np.where(objects > 0, np.where(found[:, -1] > 0, values.mean(axis=1), 0.0), math.nan)


def _interpolated(at: Reals, x: Reals, y: Reals) -> Reals:
    """What `numpy.interp` says of each row, 0 beyond the last place.

    Args:
        at: Where, shape (m,).
        x: Places of each row, from low to high, shape (b, n).
        y: Values there, shape (b, n).

    Returns:
        Shape (b, m).
    """
    if len(x) == 1:
        return np.asarray(np.interp(at, x[0], y[0], right=0), dtype=np.float64)[None]
    above = (x[:, :, None] <= at).sum(axis=1)
    low, high = np.maximum(above - 1, 0), np.minimum(above, x.shape[1] - 1)
    x_low, x_high, y_low, y_high = (
        np.take_along_axis(values, place, axis=1) for values, place in ((x, low), (x, high), (y, low), (y, high))
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        part = np.where(x_high > x_low, (at - x_low) / (x_high - x_low), 0.0)
    return np.where(at > x[:, -1:], 0.0, y_low + np.clip(part, 0.0, 1.0) * (y_high - y_low))


def mean_errors(score: Reals, is_found: NDArray[np.bool_], errors: Reals, objects: int, *, clipped: bool) -> Reals:
    """The mean of each error over what was found, shape (5,).

    Args:
        score: The score of each prediction, falling, shape (n,).
        is_found: Whether each is a label object.
        errors: The errors of those that are, shape (found, 5), nan where unknown.
        objects: How many label objects there are.
        clipped: Whether means up to each recall are averaged over the recalls reached, from above 10 %.
    """
    if not clipped:
        return np.array([_mean(errors[:, place]) for place in range(len(ERRORS))])
    if not len(errors) or not objects:
        return np.ones(len(ERRORS))
    samples = np.linspace(0, 1, _SAMPLES)
    recall = np.cumsum(is_found) / objects
    reached = np.interp(samples, recall, score, right=0)
    positive = np.flatnonzero(reached)
    first, last = round(100 * _NEAREST) + 1, int(positive[-1]) if len(positive) else 0
    if last < first:
        return np.ones(len(ERRORS))
    own = score[is_found]
    found = np.empty(len(ERRORS))
    for place in range(len(ERRORS)):
        means: Reals = np.interp(reached[::-1], own[::-1], _running_mean(errors[:, place])[::-1])[::-1]
        found[place] = means[first : last + 1].mean()
    return found


def _mean(values: Reals) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else math.nan


def _running_mean(values: Reals) -> Reals:
    """The mean of the values so far, without those that are unknown; all ones where nothing is known."""
    known = ~np.isnan(values)
    if not known.any():
        return np.ones(len(values))
    counts = np.cumsum(known)
    sums = np.nancumsum(values)
    return np.divide(sums, counts, out=np.zeros(len(values)), where=counts != 0)


def resampled_errors(sums: Reals, counts: Reals, found: Reals, objects: Reals, *, clipped: bool) -> Reals:
    """The mean of one error in each resample, shape (b,); nan where nothing was found.

    Args:
        sums: Sum of the error over what was found up to each class of scores, shape (b, n).
        counts: How many of these have a known error.
        found: How many were found.
        objects: How many label objects there are, shape (b,).
        clipped: See `mean_errors`.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        means = sums / counts
        recall = found / objects[:, None]
    if not clipped:
        return means[:, -1]
    samples: Reals = np.linspace(0, 1, _SAMPLES)[round(100 * _NEAREST) + 1 :]
    known = counts > 0
    # before anything is known it is what becomes known first
    begin: NDArray[np.int64] = np.argmax(known, axis=1)
    told = np.take_along_axis(means, np.maximum(np.arange(means.shape[1], dtype=np.int64), begin[:, None]), axis=1)
    reached = samples <= recall[:, -1:]
    between = np.where(reached, _interpolated(samples, recall, told), 0.0)
    number = np.maximum(np.count_nonzero(reached, axis=1), 1)
    values = np.where(reached.any(axis=1), between.sum(axis=1) / number, 1.0)
    return np.where(known.any(axis=1), values, math.nan)
