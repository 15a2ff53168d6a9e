"""The last lane of a track: what tells where somebody drives whose heading fits another lane, as in a U-turn.

The lanes of a label object are, of several that lie at its place, those that lead within 60 degrees of its heading, and
those that continue the last lane of its track; where there is none, or no heading, all. The *last lane* is the one
that was its only lane when it last had a single one; where that leads across its heading and continues nothing, it has
none. A lane continues itself, and those that lead to it. Nothing is known across `LONGEST_GAP_US`.

Computed once, when a dataset is written; kept only where it tells more than the heading does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.angles import leads
from scenicq.store.motion import LONGEST_GAP_US, track_numbers

__all__ = ["LanePairs", "last_lanes", "tracks_of_both"]

NONE = -1
"""The number of no lane."""


class LanePairs:
    """Which lanes lie where label objects are.

    Attributes:
        member: The number of a label object, ascending, shape (n,).
        lane: A lane there, shape (n,).
    """

    def __init__(self, member: NDArray[np.int64], lane: NDArray[np.int64]) -> None:
        """Take the pairs, those of one member together."""
        self.member, self.lane = member, lane


def tracks_of_both(egos: Sequence[str | None], objects: Sequence[str | None]) -> NDArray[np.int64]:
    """Numbers of tracks of egos, then of objects, of which none is of both; below 0 of what is seen once."""
    of_egos, of_objects = track_numbers(egos), track_numbers(objects)
    first = int(of_egos.max(initial=NONE)) + 1
    return np.concatenate((of_egos, np.where(of_objects < 0, of_objects - len(egos), of_objects + first)))


def last_lanes(
    times_us: NDArray[np.int64],
    tracks: NDArray[np.int64],
    headings: NDArray[np.float64],
    pairs: LanePairs,
    ways: Callable[[NDArray[np.int64], NDArray[np.int64]], list[tuple[float, ...]]],
    continued: Callable[[int], frozenset[int]],
) -> NDArray[np.int64]:
    """The last lane of each label object's track, where it tells more than its heading; else `NONE`.

    Args:
        times_us: When each is seen, shape (n,).
        tracks: The number of the track of each; below 0 of what is seen once.
        headings: That of each; nan where it is not known.
        pairs: The lanes where they are.
        ways: The directions of lanes, the second, where members are, the first.
        continued: The lanes that a lane continues, itself among them.
    """
    found = np.full(len(times_us), NONE)
    member, lane = pairs.member, pairs.lane
    counts = np.bincount(member, minlength=len(times_us))
    tracked = (tracks >= 0) & ~np.isnan(headings)
    # most are in one lane, or in several that lead their way
    several = np.flatnonzero((counts[member] > 1) & tracked[member])
    leads = np.ones(len(member), np.bool_)
    leads[several] = _lead(several, pairs, headings, ways)
    asked = np.zeros(int(tracks.max(initial=NONE)) + 1, np.bool_)
    asked[tracks[member[~leads]]] = True
    if not asked.any():
        return found
    mine = np.flatnonzero(tracks >= 0)
    mine = mine[asked[tracks[mine]]]
    chosen = np.zeros(len(times_us), np.bool_)
    chosen[mine] = True
    alone = np.flatnonzero((counts[member] == 1) & (chosen & tracked)[member])
    leads[alone] = _lead(alone, pairs, headings, ways)

    starts = np.concatenate(([0], np.cumsum(counts)))
    last, before = NONE, (NONE, 0)
    for number in mine[np.lexsort((times_us[mine], tracks[mine]))].tolist():
        track, time = int(tracks[number]), int(times_us[number])
        if track != before[0] or time - before[1] > LONGEST_GAP_US:
            last = NONE
        before = track, time
        first, end = int(starts[number]), int(starts[number + 1])
        lanes = lane[first:end].tolist()
        if not lanes:
            continue
        if math.isnan(headings[number]):
            own = lanes
        else:
            own = [each for each, along in zip(lanes, leads[first:end].tolist(), strict=True) if along]
            further = [each for each in lanes if each not in own and last in continued(each)]
            if further and len(lanes) > 1:
                found[number] = last
            own += further
        if len(own) == 1:
            last = own[0]
        elif len(lanes) == 1:
            last = NONE
    return found


def _lead(
    some: NDArray[np.intp],
    pairs: LanePairs,
    headings: NDArray[np.float64],
    ways: Callable[[NDArray[np.int64], NDArray[np.int64]], list[tuple[float, ...]]],
) -> NDArray[np.bool_]:
    """Whether the lanes of some pairs lead the way that members go."""
    member, lane = pairs.member[some], pairs.lane[some]
    asked = zip(ways(member, lane), headings[member].tolist(), strict=True)
    return np.array([leads(each, heading) for each, heading in asked], dtype=np.bool_)
