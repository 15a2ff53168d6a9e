"""Lanes whose neighbours change along them: cut where they do, so that each part has one on either side.

A cut goes on through the neighbours beside it, so that parts beside each other begin and end together.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

__all__ = ["AdjacentLane", "LanePart", "cut_lanes"]


@dataclass(frozen=True, slots=True)
class AdjacentLane:
    """A lane beside a stretch of another.

    Attributes:
        lane: Its id.
        is_left: On which side it lies.
        start, end: Where the stretch begins and ends, as shares of the lane's length.
        its_start, its_end: The same of the lane beside.
    """

    lane: str
    is_left: bool
    start: float
    end: float
    its_start: float
    its_end: float

    def across(self, share: float) -> float:
        """The place on the lane beside, as a share of its length."""
        way = (share - self.start) / (self.end - self.start)
        return self.its_start + way * (self.its_end - self.its_start)


@dataclass(frozen=True, slots=True)
class LanePart:
    """A stretch of a lane with one neighbour on either side.

    Attributes:
        start, end: As shares of the lane's length.
        left, right: Lane and number of the part beside it; None where there is none.
    """

    start: float
    end: float
    left: tuple[str, int] | None
    right: tuple[str, int] | None


def cut_lanes(lengths: Mapping[str, float], beside: Mapping[str, Sequence[AdjacentLane]], least_m: float) -> Mapping[
    str, tuple[LanePart, ...]
]:  # fmt: skip
    """The parts of each lane, in order.

    Args:
        lengths: Length of each lane, metres.
        beside: What lies beside each lane; lanes that have no length here are not there.
        least_m: Cuts nearer to each other, or to an end, are one.
    """
    cuts: dict[str, list[float]] = {name: [0.0, 1.0] for name in lengths}
    known = {
        name: [each for each in beside.get(name, ()) if each.lane in lengths and each.start < each.end]
        for name in lengths
    }
    waiting = deque((name, share) for name in lengths for each in known[name] for share in (each.start, each.end))
    while waiting:
        name, share = waiting.popleft()
        if any(abs(share - other) * lengths[name] < least_m for other in cuts[name]):
            continue
        cuts[name].append(share)
        waiting += [(each.lane, each.across(share)) for each in known[name] if each.start < share < each.end]
        waiting += list(_back(name, share, known))
    for shares in cuts.values():
        shares.sort()
    return {
        name: tuple(
            LanePart(start, end, *(_part_beside(known[name], (start + end) / 2, left, cuts) for left in (True, False)))
            for start, end in pairwise(cuts[name])
        )
        for name in lengths
    }


def _back(name: str, share: float, known: Mapping[str, Sequence[AdjacentLane]]) -> Iterator[tuple[str, float]]:
    """Where a cut of a lane lies on those that name it as their neighbour."""
    for other in dict.fromkeys(each.lane for each in known[name]):
        for each in known[other]:
            low, high = sorted((each.its_start, each.its_end))
            if each.lane == name and low < share < high:
                way = (share - each.its_start) / (each.its_end - each.its_start)
                yield other, each.start + way * (each.end - each.start)


def _part_beside(
    known: Sequence[AdjacentLane], share: float, is_left: bool, cuts: Mapping[str, Sequence[float]]
) -> tuple[str, int] | None:
    each = next((each for each in known if each.is_left == is_left and each.start <= share <= each.end), None)
    if each is None:
        return None
    place = each.across(share)
    return each.lane, max(0, sum(cut <= place for cut in cuts[each.lane][:-1]) - 1)
