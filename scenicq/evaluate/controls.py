"""Find controls: for each object in question others of its class and visibility, about as far away.

Others are sought in the same frame first, then in the same recording, then in the same cluster of recordings, and at
last anywhere under the same parameters: what a frame or a recording has of its own is then in both groups. Distance
is a number: others lie within a caliper, and on both sides, so that nothing is told of distances that only one group
has (Rosenbaum 2010, "Design of Observational Studies", chapters 8 and 9). What difference of distance is left is
taken out by a regression that is made of all of them.

The difference of the two rates is then a weighted sum over objects of whether each was missed, with weights that hang
on labels alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.evaluate.resampling import means_by

__all__ = ["CALIPER", "PLACES", "Controls", "Likeness", "find_controls", "number_of"]

Reals = NDArray[np.float64]
Numbers = NDArray[np.int64]
Bools = NDArray[np.bool_]

CALIPER = 0.2
"""Others are nearer or farther by this share of the distance at most."""
_LEAST_CALIPER_M = 3.0
_EDGE = 0.1
"""Share of the caliper by which an object may lie outside of all others."""
PLACES = ("frame", "recording", "cluster", "elsewhere")
"""Where others are sought, in this order; at last under the same parameters."""
_BENDS = (0.2, 0.4, 0.6, 0.8)
"""Quantiles of the distances at which the curve of the regression bends."""
_RIDGE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Likeness:
    """What makes objects alike, shape (objects,) each.

    Attributes:
        kind: Number of the class and visibility.
        category: Number of the class.
        distance: From the ego, metres.
        frame, recording, cluster: Numbers of each.
        params: Number of the combination of parameters.
    """

    kind: Numbers
    category: Numbers
    distance: Reals
    frame: Numbers
    recording: Numbers
    cluster: Numbers
    params: Numbers

    def taken(self, which: Numbers) -> Likeness:
        """Select some of the objects."""
        return Likeness(*(getattr(self, name)[which] for name in self.__slots__))


@dataclass(frozen=True, slots=True, eq=False)
class Controls:
    """The objects in question that others are alike to, and those others.

    Attributes:
        compared: Which objects in question are compared, shape (n,).
        weight: How much each other counts, 1 in all, spread as the objects in question are; 0 for those that nobody is
            like, shape (n,).
        difference: Weight of each object in the difference of the rates, distance taken into account, shape (n,).
        places: How many objects in question found others in each of `PLACES`.
        elsewhere: Objects in question whose others are of other clusters, shape (n,).
    """

    compared: Bools
    weight: Reals
    difference: Reals
    places: tuple[int, ...]
    elsewhere: Bools


def number_of(columns: Sequence[Numbers]) -> Numbers:
    """A number for each combination of numbers that are 0 or more, shape (n,)."""
    found = np.zeros(len(columns[0]), dtype=np.int64)
    for column in columns:
        _, found = np.unique(found * (int(column.max(initial=0)) + 1) + column, return_inverse=True)
    return found


class _Line:
    """Objects by key and distance, so that those of a key within a distance are a run."""

    def __init__(self, key: Numbers, distance: Reals, farthest: float) -> None:
        self._step = 4.0 * farthest + 100.0
        self._key, self._distance = key, distance
        self.order = np.argsort(key * self._step + distance, kind="stable")
        self._places = (key * self._step + distance)[self.order]

    def runs(self, key: Numbers, low: Reals, high: Reals) -> tuple[Numbers, Numbers]:
        """Where the run of each begins and ends."""
        first = np.searchsorted(self._places, key * self._step + low, side="left")
        return first, np.searchsorted(self._places, key * self._step + high, side="right")


def find_controls(mine: Bools, others: Bools, like: Likeness) -> Controls:
    """Find the controls of each object in question.

    Args:
        mine: The objects in question, shape (n,).
        others: Those that they may be compared with.
        like: What makes them alike.
    """
    count = len(mine)
    own, theirs = np.flatnonzero(mine), np.flatnonzero(others)
    if not len(own) or not len(theirs):
        nobody = np.zeros(count, dtype=np.bool_)
        return Controls(nobody, np.zeros(count), np.zeros(count), (0,) * len(PLACES), nobody)
    away, reach = like.distance[own], _reach(like.distance[own])
    farthest = float(like.distance[mine | others].max())
    left = _between(own, theirs, like, reach, farthest)
    total = np.zeros(count)
    places: list[int] = []
    elsewhere = np.zeros(count, dtype=np.bool_)
    compared = np.zeros(count, dtype=np.bool_)
    for place, key in zip(PLACES, _keys(like), strict=True):
        if not left.any():
            places.append(0)
            continue
        line = _Line(key[theirs], like.distance[theirs], farthest)
        first, last = line.runs(key[own], away - reach, away + reach)
        found = left & (last > first)
        # each object in question gives its run one unit, in equal parts
        steps = np.zeros(len(theirs) + 1)
        part = 1.0 / (last[found] - first[found])
        np.add.at(steps, first[found], part)
        np.add.at(steps, last[found], -part)
        total[theirs[line.order]] += np.cumsum(steps)[:-1]
        places.append(int(found.sum()))
        compared[own[found]] = True
        if place == PLACES[-1]:
            elsewhere[own[found]] = True
        left &= ~found
    number = int(compared.sum())
    # what is left of additions and subtractions
    weight = np.where(total > 1e-9, total, 0.0) / max(number, 1)
    difference = np.where(compared, 1.0 / max(number, 1), 0.0) - weight
    return Controls(compared, weight, _at_one_distance(difference, compared, like), tuple(places), elsewhere)


def _reach(distance: Reals) -> Reals:
    return np.maximum(_LEAST_CALIPER_M, CALIPER * distance)


def _keys(like: Likeness) -> Iterator[Numbers]:
    """What objects of one place share."""
    kinds = int(like.kind.max(initial=0)) + 1
    for column in (like.frame, like.recording, like.cluster, like.params):
        yield column * kinds + like.kind


def _between(own: Numbers, theirs: Numbers, like: Likeness, reach: Reals, farthest: float) -> Bools:
    """Which objects in question have others of their kind both nearer and farther, within the caliper."""
    line = _Line(like.kind[theirs], like.distance[theirs], farthest)
    key, away = like.kind[own], like.distance[own]
    found = np.ones(len(own), dtype=np.bool_)
    for low, high in ((-reach, _EDGE * reach), (-_EDGE * reach, reach)):
        first, last = line.runs(key, away + low, away + high)
        found &= last > first
    return found


def _at_one_distance(difference: Reals, compared: Bools, like: Likeness) -> Reals:
    """The weights of a difference, less what a regression over distance makes of the distances that still differ.

    The regression is one of each class, within recordings and kinds, with a curve of straight pieces and the group as a
    column, so that what the group does is not taken for what distance does.
    """
    found = difference.copy()
    used = np.flatnonzero(difference)
    for category in np.unique(like.category[used]).tolist():
        rows = used[like.category[used] == category]
        weight = np.abs(difference[rows])
        curve = _curve(like.distance[rows], like.distance[rows[compared[rows]]])
        columns = np.column_stack((curve, compared[rows].astype(np.float64)))
        gap = curve.T @ difference[rows]
        group = number_of((like.recording[rows], like.kind[rows]))
        inside = columns - np.column_stack([means_by(group, each, weight) for each in columns.T])
        square = inside.T @ (weight[:, None] * inside)
        scale = np.sqrt(np.maximum(np.diag(square), 1e-12))
        square = square / scale[:, None] / scale + _RIDGE * np.eye(len(scale))
        slopes = np.linalg.solve(square, np.append(gap, 0.0) / scale) / scale
        found[rows] -= weight * (inside @ slopes)
    return found


def _curve(distance: Reals, asked: Reals) -> Reals:
    """Columns of a curve of straight pieces, shape (n, pieces)."""
    bends = np.unique(np.quantile(asked, _BENDS)) if len(asked) else np.zeros(0)
    bends = bends[(bends > distance.min(initial=0.0)) & (bends < distance.max(initial=0.0))]
    return np.column_stack((distance, *(np.maximum(distance - bend, 0.0) for bend in bends.tolist())))
