"""Where a driver may come to who keeps to a lane: the lane, and all that it leads to.

At a junction Scenic's library goes straight on where the lane allows it, else any way that there is. Maps cut lanes as
they like: where a lane ends outside of junctions, all that follow it count.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from scenicq.compiler.elements import of_element
from scenicq.errors import Span
from scenicq.geometry.elements import Intersection, Lane
from scenicq.geometry.regions import DeferredPolygons, PolygonSet

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["dead_ends", "lane_course", "lanes_and_junctions", "lanes_from", "ways_on"]


def lane_course(run: Interpreter, lane: Lane, span: Span, *, against: bool = False) -> PolygonSet:
    """The area of a lane and of all lanes that it leads to, worked out when it is asked for.

    Args:
        run: The run of the program.
        lane: The lane where it begins.
        span: Where the program asks for it.
        against: Whether the lane is driven against its direction.
    """
    key = lane, against
    if key not in run.lookups.courses:
        name = f"{lane.name} and what it leads {'here from' if against else 'to'}"
        run.lookups.courses[key] = DeferredPolygons(
            name, lambda: lanes_and_junctions(lanes_from(run, lane, span, against=against), name)
        )
    return run.lookups.courses[key]


def lanes_and_junctions(lanes: Iterable[Lane], name: str) -> PolygonSet:
    """The area of some lanes, and of the junctions that lanes among them cross."""
    lanes = tuple(lanes)
    junctions = dict.fromkeys(junction for each in lanes if (junction := _junction(each)) is not None)
    return PolygonSet((*(each.polygon for each in lanes), *(each.polygon for each in junctions)), name)


def lanes_from(run: Interpreter, lane: Lane, span: Span, *, against: bool = False) -> tuple[Lane, ...]:
    """The lane and all lanes that it leads to."""
    found, waiting = {lane: None}, [lane]
    while waiting:
        now = waiting.pop()
        following = now.predecessors if against else ways_on(run, now, span)
        for each in following:
            if each not in found:
                found[each] = None
                waiting.append(each)
    return tuple(found)


def ways_on(run: Interpreter, lane: Lane, span: Span) -> tuple[Lane, ...]:
    """The lanes behind the end of a lane, of junctions those of the ways that are chosen."""
    ways = lane.maneuvers
    if not ways:
        return lane.successors
    straight = [each for each in ways if of_element(run, each, "type", span) == "STRAIGHT"]
    chosen = straight or ways
    return tuple(dict.fromkeys(each for way in chosen for each in (way.connectingLane or way.endLane, way.endLane)))


def dead_ends(lanes: Iterable[Lane]) -> tuple[tuple[Lane, tuple[float, float]], ...]:
    """The lanes that lead nowhere, each with where its centreline ends."""
    found: list[tuple[Lane, tuple[float, float]]] = []
    for lane in lanes:
        if lane.centerline is not None and not lane.successors and _junction(lane) is None:
            x, y = lane.centerline.lines[-1].coords[-1][:2]
            found.append((lane, (x, y)))
    return tuple(found)


def _junction(lane: Lane) -> Intersection | None:
    return lane.road.intersection if lane.road is not None else None
