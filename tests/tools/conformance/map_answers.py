"""What Scenic's network says at points and of its elements, as plain data. Runs where Scenic is, as `draw_scenes`."""

from __future__ import annotations

import random
from enum import Enum
from typing import Any

import numpy as np
from map_attributes import ATTRIBUTES, LOOKED_UP, NETWORK_LOOK_UPS
from scenic.core.distributions import RejectionException
from scenic.core.vectors import Vector


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
                **{name: plain(getattr(network, name)(point)) for name in NETWORK_LOOK_UPS},
                "nominalDirectionsAt": [float(each.yaw) for each in network.nominalDirectionsAt(point)],
            }
        )
    return found


def of_elements(network: Any, count: int, seed: int) -> list[dict[str, Any]]:
    """What the network and each element, maneuver and signal say, and what they say of some points.

    Args:
        network: Scenic's.
        count: Points of each element; half of them lie in it, the others around it.
        seed: The seed of the random numbers.
    """
    random.seed(seed)
    np.random.seed(seed)
    found = [{"kind": "Network", "name": "network", "says": _said(network, "Network")}]
    for element in network.elements.values():
        kind = type(element).__name__
        points = [_place(element, inside=number % 2 == 0) for number in range(count)]
        at = [_at_point(element, kind, point) for point in points]
        found.append({"kind": kind, "name": element.uid, "says": _said(element, kind), "points": at})
        for name, plural in (("Maneuver", "maneuvers"), ("Signal", "signals")):
            own = getattr(element, plural, ()) if kind != "Lane" or name == "Signal" else ()
            for number, each in enumerate(own):
                found.append({"kind": name, "name": f"{element.uid}.{plural}[{number}]", "says": _said(each, name)})
    return found


def _place(element: Any, inside: bool) -> Any:
    if inside:
        return element.uniformPointInner()
    west, south, east, north = element.polygon.bounds
    return Vector(random.uniform(west - 5, east + 5), random.uniform(south - 5, north + 5))


def _at_point(element: Any, kind: str, point: Any) -> dict[str, Any]:
    asked = {name: plain(getattr(element, name)(point)) for name in LOOKED_UP.get(kind, ())}
    asked["orientation"] = float(element.orientation[point].yaw)
    asked["nominalDirectionsAt"] = [float(each.yaw) for each in element.nominalDirectionsAt(point)]
    return {"x": float(point.x), "y": float(point.y), **asked}


def _said(thing: Any, kind: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name in ATTRIBUTES[kind]:
        try:
            found[name] = plain(getattr(thing, name))
        except RejectionException:
            found[name] = "rejected"
    return found


def plain(value: Any) -> Any:
    """A value as JSON knows it: elements by name, regions by what they measure."""
    if hasattr(value, "connectingLane"):
        return [plain(lane) for lane in (value.startLane, value.connectingLane, value.endLane)]
    if hasattr(value, "uid"):
        return value.uid
    if hasattr(value, "lineString"):
        line = value.lineString
        return {"points": len(value.points), "length": line.length, "middle": [line.centroid.x, line.centroid.y]}
    if hasattr(value, "polygons"):
        area = value.polygons
        return {"area": area.area, "middle": [area.centroid.x, area.centroid.y]} if area.area else {"area": 0.0}
    if isinstance(value, dict):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [plain(each) for each in value]
    if isinstance(value, frozenset):
        return sorted(str(each) for each in value)
    if isinstance(value, Enum):
        return value.name
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return {"area": 0.0}  # the empty region
