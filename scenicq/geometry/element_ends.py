"""What lies before and behind the elements of a map that only says so of lanes."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import pairwise
from typing import cast

from scenicq.geometry.elements import Lane, LaneGroup, LongElement, NetworkElement, Road

__all__ = ["derive_ends"]

_AHEAD, _BEHIND = "_successor", "_predecessor"


def derive_ends(lanes: Collection[Lane], groups: Collection[LaneGroup], roads: Collection[Road]) -> None:
    """Fill in the ends of sections, groups and roads by those of lanes."""
    for lane in lanes:
        for before, behind in pairwise(lane.sections):
            setattr(before, _AHEAD, behind)
            setattr(behind, _BEHIND, before)
        after, before = (cast("Lane | None", _end(lane, name)) for name in (_AHEAD, _BEHIND))
        if after is not None:
            setattr(lane.sections[-1], _AHEAD, after.sections[0])
        if before is not None:
            setattr(lane.sections[0], _BEHIND, before.sections[-1])
    for group in groups:
        for name in (_AHEAD, _BEHIND):
            setattr(group, name, _beyond(group.lanes, name))
    for road in roads:
        for name, back in ((_AHEAD, _BEHIND), (_BEHIND, _AHEAD)):
            group, way = (road.forwardLanes, name) if road.forwardLanes else (road.backwardLanes, back)
            far = _end(group, way) if group else None
            setattr(road, name, far.road if isinstance(far, LaneGroup) else far)


def _end(element: LongElement, name: str) -> NetworkElement | None:
    return element.__dict__[name]


def _beyond(lanes: Sequence[Lane], name: str) -> NetworkElement | None:
    """The intersection that lanes lead to, else the group of lanes that one of them leads to."""
    for lane in lanes:
        other = cast("Lane | None", _end(lane, name))
        crossing = other.road.intersection if other is not None and other.road is not None else None
        if crossing is not None and lane not in crossing.lanes:
            return crossing
        if other is not None:
            return other.group
    return None
