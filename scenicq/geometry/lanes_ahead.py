"""What a lane leads to: each lane on the way, with how far behind the end of the first it begins."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable

from scenicq.geometry.elements import Lane

__all__ = ["lanes_from"]


def lanes_from(lane: Lane, distance: float, step: Callable[[], None] = lambda: None) -> dict[Lane, float]:
    """A lane and all lanes that it leads to which begin at most so far behind its end, each with how far that is.

    Args:
        lane: The lane, which begins at 0.
        distance: Metres along centrelines.
        step: Called at each lane.
    """
    begins: dict[Lane, float] = {lane: 0.0}
    waiting = [(0.0, 0, lane)]
    while waiting:
        step()
        far, _, now = heapq.heappop(waiting)
        if far > begins[now]:
            continue
        end = far + (0.0 if now is lane else _length(now))
        for each in now.successors:
            if end <= distance and end < begins.get(each, math.inf):
                begins[each] = end
                heapq.heappush(waiting, (end, len(begins), each))
    return begins


def _length(lane: Lane) -> float:
    """Metres along a lane; half of what runs around it where the map has no centreline."""
    return lane.polygon.length / 2 if lane.centerline is None else sum(line.length for line in lane.centerline.lines)
