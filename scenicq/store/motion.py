"""Observed motion of every track of a recording: velocity, acceleration along the heading, yaw rate.

A label's own velocity counts first. What a label does not say comes from differences over the neighbouring samples of
its track: central where it has two neighbours, else one-sided, never across more than `LONGEST_GAP_US` (as the nuScenes
devkit does). Computed once, when a dataset is written.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.angles import normalize_array
from scenicq.store.columns import MemberColumns

__all__ = ["LONGEST_GAP_US", "MotionColumns", "motion_of", "track_numbers"]

LONGEST_GAP_US = 1_500_000
"""Microseconds between two samples of a track beyond which neither says anything of the other."""

Numbers = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class MotionColumns:
    """Observed motion of some egos or label objects, one element each, shape (n,); nan where nothing is observed.

    Attributes:
        vx, vy: Velocity in metres per second, map frame: the label's own, else derived.
        acceleration: Change of the velocity along the heading, metres per second squared; always derived.
        yaw_rate: Change of the heading, radians per second, counter-clockwise; always derived.
        derived: Whether the velocity is derived.
    """

    vx: Numbers
    vy: Numbers
    acceleration: Numbers
    yaw_rate: Numbers
    derived: NDArray[np.bool_]


def motion_of(times_us: NDArray[np.int64], members: MemberColumns, tracks: Sequence[str | None]) -> MotionColumns:
    """The motion of the egos or of the label objects of one recording.

    Args:
        times_us: Timestamp of each, shape (n,), ascending.
        members: Their properties.
        tracks: Which of them are one and the same; None for what is seen only once.
    """
    steps = _Steps.of(times_us, tracks)
    x, y = steps.rate(members.x), steps.rate(members.y)
    derived = np.isnan(members.vx) & ~np.isnan(x)
    vx, vy = np.where(derived, x, members.vx), np.where(derived, y, members.vy)
    sine, cosine = np.sin(members.heading), np.cos(members.heading)
    acceleration = steps.rate(vy) * cosine - steps.rate(vx) * sine
    return MotionColumns(vx, vy, acceleration, steps.rate(members.heading, turns=True), derived)


def track_numbers(tracks: Sequence[str | None]) -> NDArray[np.int64]:
    """Numbers of tracks, in the order in which they come first; what has no track is one of its own, below 0."""
    numbers: dict[str, int] = {}
    return np.array(
        [~place if name is None else numbers.setdefault(name, len(numbers)) for place, name in enumerate(tracks)],
        dtype=np.int64,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Steps:
    """The neighbours of each sample on its track; its own number where there is none near enough."""

    times_us: NDArray[np.int64]
    before: NDArray[np.intp]
    after: NDArray[np.intp]

    @classmethod
    def of(cls, times_us: NDArray[np.int64], tracks: Sequence[str | None]) -> _Steps:
        """Find the neighbours."""
        track = track_numbers(tracks)
        order = np.argsort(track, kind="stable")
        times = times_us[order]
        gap = np.diff(times)
        near = (np.diff(track[order]) == 0) & (gap > 0) & (gap <= LONGEST_GAP_US)
        before, after = np.arange(len(order)), np.arange(len(order))
        before[order[1:][near]] = order[:-1][near]
        after[order[:-1][near]] = order[1:][near]
        return cls(times_us, before, after)

    def rate(self, values: Numbers, *, turns: bool = False) -> Numbers:
        """Change a second of some values, over those neighbours that have one; `turns` for angles."""
        there = ~np.isnan(values)
        own = np.arange(len(values))
        first = np.where(there[self.before], self.before, own)
        last = np.where(there[self.after], self.after, own)
        seconds = (self.times_us[last] - self.times_us[first]) / 1e6
        ahead, behind = values[last] - values, values - values[first]
        change = normalize_array(ahead) + normalize_array(behind) if turns else values[last] - values[first]
        return np.divide(change, seconds, out=np.full(len(values), np.nan), where=seconds > 0)
