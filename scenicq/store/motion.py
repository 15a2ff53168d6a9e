"""Observed motion of every track of a recording: velocity, acceleration along the heading, yaw rate.

A label's own velocity counts first. What a label does not say comes from differences over the neighbouring samples of
its track: central where it has two neighbours, else one-sided, never across more than `LONGEST_GAP_US` (as the nuScenes
devkit does). An acceleration is the slope of a line through the speeds of at least a second and four samples: a
difference of two speeds, which are differences themselves, is mostly noise. Computed once, when a dataset is written.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.angles import normalize_array
from scenicq.store.columns import MemberColumns

__all__ = ["FITTED_S", "FITTED_SAMPLES", "LONGEST_GAP_US", "MotionColumns", "motion_of", "slopes", "track_numbers"]

LONGEST_GAP_US = 1_500_000
"""Microseconds between two samples of a track beyond which neither says anything of the other."""
FITTED_S = 1.0
"""Seconds of which a derived acceleration is the slope of speed, at least."""
FITTED_SAMPLES = 4
"""Samples of which it is that, at least."""

Numbers = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class MotionColumns:
    """Observed motion of some egos or label objects, one element each, shape (n,); nan where nothing is observed.

    Attributes:
        vx, vy: Velocity in metres per second, map frame: the label's own, else derived.
        acceleration: Slope of the speed, which is negative backwards, metres per second squared; always derived.
        yaw_rate: Change of the heading, radians per second, counter-clockwise; always derived.
        derived: Whether the velocity is derived.
    """

    vx: Numbers
    vy: Numbers
    acceleration: Numbers
    yaw_rate: Numbers
    derived: NDArray[np.bool_]


def motion_of(times_us: NDArray[np.int64], members: MemberColumns, tracks: Sequence[str | None]) -> MotionColumns:
    """Derive the motion of the egos, or of the label objects, of one recording.

    Args:
        times_us: Timestamp of each, shape (n,), ascending.
        members: Their properties.
        tracks: The track of each; None for what is seen only once.
    """
    steps = _Steps.of(times_us, tracks)
    x, y = steps.rate(members.x), steps.rate(members.y)
    derived = np.isnan(members.vx) & ~np.isnan(x)
    vx, vy = np.where(derived, x, members.vx), np.where(derived, y, members.vy)
    sine, cosine = np.sin(members.heading), np.cos(members.heading)
    with np.errstate(over="ignore", invalid="ignore"):
        backwards = vy * cosine - vx * sine < 0
        speed = np.where(np.isnan(members.heading), np.nan, np.hypot(vx, vy) * np.where(backwards, -1.0, 1.0))
    acceleration = slopes(times_us, speed, tracks)
    return MotionColumns(vx, vy, acceleration, steps.rate(members.heading, turns=True), derived)


def track_numbers(tracks: Sequence[str | None]) -> NDArray[np.int64]:
    """Number the tracks in the order in which they first occur; an object without one gets a number below 0."""
    numbers: dict[str, int] = {}
    return np.array(
        [~place if name is None else numbers.setdefault(name, len(numbers)) for place, name in enumerate(tracks)],
        dtype=np.int64,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Steps:
    """The neighbours of each sample on its track, or the sample itself where none is near enough."""

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
        """The change of some values a second, between the neighbours that have one; `turns` for angles."""
        there = ~np.isnan(values)
        own = np.arange(len(values))
        first = np.where(there[self.before], self.before, own)
        last = np.where(there[self.after], self.after, own)
        seconds = (self.times_us[last] - self.times_us[first]) / 1e6
        ahead, behind = values[last] - values, values - values[first]
        change = normalize_array(ahead) + normalize_array(behind) if turns else values[last] - values[first]
        return np.divide(change, seconds, out=np.full(len(values), np.nan), where=seconds > 0)


@np.errstate(over="ignore", invalid="ignore")
def slopes(times_us: NDArray[np.int64], values: Numbers, tracks: Sequence[str | None]) -> Numbers:
    """Fit a line to the values around each sample: its slope a second, nan where the track has too few samples.

    The samples are those of the track that have a value, equally many on both sides, as long as there are any. Values
    near the largest floats may have no finite slope.
    """
    known = np.flatnonzero(~np.isnan(values))
    track = track_numbers(tracks)[known]
    order = known[np.argsort(track, kind="stable")]
    times, speeds = times_us[order] / 1e6, values[order]
    gap = np.diff(times_us[order])
    whole = (np.diff(np.sort(track, kind="stable")) == 0) & (gap > 0) & (gap <= LONGEST_GAP_US)
    stretch = np.concatenate(([0], np.cumsum(~whole)))[: len(order)]
    first = np.searchsorted(stretch, stretch, side="left")
    last = np.searchsorted(stretch, stretch, side="right") - 1
    found = np.full(len(values), np.nan)
    place = np.arange(len(order))
    # sums over the samples of each window: one, t, t^2, v and t * v, with t from the middle sample for precision
    sums = np.stack([np.ones(len(order)), *np.zeros((2, len(order))), speeds, np.zeros(len(order))])
    low, high = place.copy(), place.copy()
    while len(place):
        for step, end in ((-1, first[place]), (1, last[place])):
            reached = low if step < 0 else high
            more = np.flatnonzero(reached != end)
            reached[more] += step
            t, v = times[reached[more]] - times[place[more]], speeds[reached[more]]
            sums[:, more] += np.stack([np.ones(len(more)), t, t * t, v, t * v])
        count, t, square, v, product = sums
        enough = (count >= FITTED_SAMPLES) & (times[high] - times[low] >= FITTED_S - 1e-6)
        slope = (count * product - t * v)[enough] / (count * square - t * t)[enough]
        found[order[place[enough]]] = np.where(np.isfinite(slope), slope, np.nan)
        going_on = ~enough & ((low > first[place]) | (high < last[place]))
        place, low, high, sums = place[going_on], low[going_on], high[going_on], sums[:, going_on]
    return found
