"""The last lane of a track: tells the lanes of a vehicle whose heading fits another lane, as in a U-turn.

Several lanes may overlap where a vehicle is. Its *own lanes* are those within 60 degrees of its heading, and those that
continue the last lane of its track; without a heading, all that lie there. Along a track, sample by sample:

- Where a sample has one own lane, that is the last lane from then on.
- Where there is one lane and it is not the sample's own, the track has no last lane from then on.
- Elsewhere, the last lane stays what it was. After a gap longer than `LONGEST_GAP_US` there is none.

A lane continues itself and the lanes that lead to it. Last lanes are computed once, when a dataset is written. They are
stored only where they tell more than the heading does: where a lane is a sample's own by the last lane alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.angles import leads
from scenicq.store.motion import LONGEST_GAP_US, track_numbers

__all__ = ["LanePairs", "ego_and_object_tracks", "last_lanes"]

_NO_LANE = -1
_NO_TRACK = -1

_Numbers = NDArray[np.int64]
_LaneHeadings = Callable[[_Numbers, _Numbers], list[tuple[float, ...]]]


class LanePairs:
    """Which lanes lie where label objects are.

    Attributes:
        member: Row of a label object, ascending, shape (n,).
        lane: Number of a lane at its position, shape (n,).
    """

    def __init__(self, member: _Numbers, lane: _Numbers) -> None:
        """Take the pairs, those of one member together."""
        self.member, self.lane = member, lane


def ego_and_object_tracks(egos: Sequence[str | None], objects: Sequence[str | None]) -> _Numbers:
    """Number the tracks of egos, then those of label objects, with no number of both; below 0 where there is none."""
    ego_numbers, object_numbers = track_numbers(egos), track_numbers(objects)
    first_free = int(ego_numbers.max(initial=_NO_TRACK)) + 1
    shifted = np.where(object_numbers < 0, object_numbers - len(egos), object_numbers + first_free)
    return np.concatenate((ego_numbers, shifted))


def last_lanes(
    times_us: _Numbers,
    tracks: _Numbers,
    headings: NDArray[np.float64],
    pairs: LanePairs,
    lane_headings: _LaneHeadings,
    predecessors: Callable[[int], frozenset[int]],
) -> _Numbers:
    """The last lane of each label object's track, -1 where it tells no more than the heading does; shape (n,).

    Args:
        times_us: Timestamps of the label objects, shape (n,).
        tracks: Numbers of their tracks, below 0 for what is seen once, shape (n,).
        headings: Radians, nan where unknown, shape (n,).
        pairs: The lanes where they are.
        lane_headings: The headings of a lane (one, or one for each way it is driven) at a label object's position,
            from rows of label objects and numbers of lanes.
        predecessors: The lanes that lead to a lane, and the lane itself.
    """
    found = np.full(len(times_us), _NO_LANE)
    lane_counts = np.bincount(pairs.member, minlength=len(times_us))
    comparable = (tracks >= 0) & ~np.isnan(headings)
    aligned = np.ones(len(pairs.member), np.bool_)

    # most tracks meet only lanes along their heading: one look at overlapping lanes finds the few that do not
    overlapping = np.flatnonzero((lane_counts[pairs.member] > 1) & comparable[pairs.member])
    aligned[overlapping] = _are_aligned(overlapping, pairs, headings, lane_headings)
    ambiguous = np.zeros(int(tracks.max(initial=_NO_TRACK)) + 1, np.bool_)
    ambiguous[tracks[pairs.member[~aligned]]] = True
    if not ambiguous.any():
        return found
    members = np.flatnonzero(tracks >= 0)
    members = members[ambiguous[tracks[members]]]
    followed = np.zeros(len(times_us), np.bool_)
    followed[members] = True
    single = np.flatnonzero((lane_counts[pairs.member] == 1) & (followed & comparable)[pairs.member])
    aligned[single] = _are_aligned(single, pairs, headings, lane_headings)

    first_pairs = np.concatenate(([0], np.cumsum(lane_counts)))
    last, previous_track, previous_time = _NO_LANE, _NO_TRACK, 0
    for member in members[np.lexsort((times_us[members], tracks[members]))].tolist():
        track, time = int(tracks[member]), int(times_us[member])
        if track != previous_track or time - previous_time > LONGEST_GAP_US:
            last = _NO_LANE
        previous_track, previous_time = track, time
        here = slice(int(first_pairs[member]), int(first_pairs[member + 1]))
        lanes = pairs.lane[here].tolist()
        if not lanes:
            continue
        if math.isnan(headings[member]):
            own = lanes
        else:
            own = [lane for lane, fits in zip(lanes, aligned[here].tolist(), strict=True) if fits]
            continuing = [lane for lane in lanes if lane not in own and last in predecessors(lane)]
            if continuing and len(lanes) > 1:
                found[member] = last
            own += continuing
        if len(own) == 1:
            last = own[0]
        elif len(lanes) == 1:
            last = _NO_LANE
    return found


def _are_aligned(
    rows: NDArray[np.intp], pairs: LanePairs, headings: NDArray[np.float64], lane_headings: _LaneHeadings
) -> NDArray[np.bool_]:
    """Whether the lanes of some pairs lead where their label objects head."""
    member, lane = pairs.member[rows], pairs.lane[rows]
    compared = zip(lane_headings(member, lane), headings[member].tolist(), strict=True)
    return np.array([leads(directions, heading) for directions, heading in compared], dtype=np.bool_)
