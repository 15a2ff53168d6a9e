"""The area of a lane and of those that it leads to: maps cut lanes as they like, often after a few metres."""

from __future__ import annotations

import heapq
import math
from typing import TYPE_CHECKING

from scenicq.compiler.values import ModelValue, describe, fail
from scenicq.errors import Span
from scenicq.geometry.elements import Lane
from scenicq.geometry.regions import PolygonSet

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["lanes_ahead"]


def lanes_ahead(run: Interpreter, lane: Lane, distance: ModelValue, span: Span) -> PolygonSet:
    """A lane and all lanes that it leads to which begin at most so far behind its end.

    Args:
        run: The run of the program.
        lane: The lane.
        distance: Metres along centrelines; a known number.
        span: Where the program asks for it.

    Raises:
        ScenarioError: wrong-type, for what is no known number of metres.
    """
    if isinstance(distance, bool) or not isinstance(distance, int | float) or not math.isfinite(distance):
        raise fail("wrong-type", "`lanesAhead` needs a known number of metres", span, f"this is {describe(distance)}")
    begins: dict[Lane, float] = {lane: 0.0}
    waiting = [(0.0, 0, lane)]
    while waiting:
        run.budget.step(span)
        far, _, now = heapq.heappop(waiting)
        if far > begins[now]:
            continue
        end = far + (0.0 if now is lane else _length(now))
        for each in now.successors:
            if end <= distance and end < begins.get(each, math.inf):
                begins[each] = end
                heapq.heappush(waiting, (end, len(begins), each))
    return PolygonSet(
        tuple(each.polygon for each in begins),
        f"{lane.name} and what it leads to",
        run.network.roadDirection,
        tuple(each.id for each in begins),
    )


def _length(lane: Lane) -> float:
    """Metres along a lane; half of what runs around it where the map has no centreline."""
    return lane.polygon.length / 2 if lane.centerline is None else sum(line.length for line in lane.centerline.lines)
