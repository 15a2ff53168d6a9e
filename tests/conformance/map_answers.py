"""What Scenic's network says at points and of its elements, as plain data. Runs where Scenic is, as `draw_scenes`."""

from __future__ import annotations

import random
from typing import Any

import numpy as np

NEIGHBOURS = ("_laneToLeft", "_laneToRight", "_fasterLane", "_slowerLane")
LOOKED_UP = ("laneAt", "laneSectionAt", "laneGroupAt", "roadAt", "intersectionAt", "sidewalkAt", "shoulderAt")


def at_points(network: Any, count: int, seed: int) -> list[dict[str, Any]]:
    """The direction of traffic and what lies there, at random points of the drivable region."""
    random.seed(seed)
    np.random.seed(seed)
    found: list[dict[str, Any]] = []
    for _ in range(count):
        point = network.drivableRegion.uniformPointInner()
        found.append(
            {
                "x": float(point.x),
                "y": float(point.y),
                "direction": float(network.roadDirection[point].yaw),
                **{name: _name(getattr(network, name)(point)) for name in LOOKED_UP},
            }
        )
    return found


def of_elements(network: Any) -> dict[str, dict[str, Any]]:
    """What the elements say of each other, by name; lists whose order means nothing are sorted."""
    found: dict[str, dict[str, Any]] = {}
    for lane in network.lanes:
        found[lane.uid] = {
            "predecessor": _name(lane._predecessor),
            "successor": _name(lane._successor),
            "adjacentLanes": _names(lane.adjacentLanes),
            "sections": [each.uid for each in lane.sections],
            "maneuvers": sorted(map(_way, lane.maneuvers)),
        }
        for section in lane.sections:
            known = {name: _name(getattr(section, name)) for name in NEIGHBOURS}
            found[section.uid] = {**known, "isForward": bool(section.isForward)}
    for group in network.laneGroups:
        found[group.uid] = {"opposite": _name(group._opposite), "lanes": _names(group.lanes)}
    for road in network.allRoads:
        found[road.uid] = {"is1Way": bool(road.is1Way), "lanes": _names(road.lanes)}
    for crossing in network.intersections:
        found[crossing.uid] = {
            "is3Way": bool(crossing.is3Way),
            "is4Way": bool(crossing.is4Way),
            "isSignalized": bool(crossing.isSignalized),
            "incomingLanes": _names(crossing.incomingLanes),
            "outgoingLanes": _names(crossing.outgoingLanes),
            "maneuvers": sorted(
                [
                    _way(each),
                    each.type.name,
                    sorted(map(_way, each.reverseManeuvers)),
                    sorted(map(_way, each.conflictingManeuvers)),
                ]
                for each in crossing.maneuvers
            ),
        }
    return found


def _name(element: Any) -> str | None:
    return None if element is None else str(element.uid)


def _names(elements: Any) -> list[str]:
    return sorted({each.uid for each in elements})


def _way(maneuver: Any) -> list[str]:
    lanes = (maneuver.startLane, maneuver.connectingLane, maneuver.endLane)
    return [lane.uid if lane else "" for lane in lanes]
