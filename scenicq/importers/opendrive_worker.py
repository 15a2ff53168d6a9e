"""Runs in a process of its own, started by `opendrive`: an OpenDRIVE file in, interchange GeoJSON out.

Usage: `python opendrive_worker.py MAP.xodr MAP.geojson`. It imports nothing of this package, so the Python that runs it
only needs Scenic. Exit codes: 0 done, 3 Scenic is missing, 4 Scenic cannot read the map (the last line on stderr says
why, and at which road or junction).

Scenic 3.1.1 takes lanes on the right of every road to run along it and those on the left against it, whatever the map
says of sides and directions. Lanes that run the other way are turned here, one by one.
"""

# Scenic has no type stubs.
# pyright: reportMissingImports=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false, reportMissingTypeStubs=false

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any
from xml.etree import ElementTree

import shapely
from shapely.geometry import mapping

try:
    import resource
except ImportError:  # not on Windows
    resource = None

try:
    from scenic.domains.driving.roads import Network
except ImportError:
    Network = None

__all__ = ["Directions", "explain", "features_of"]

_MEMORY_BYTES = 8 << 30
"""A map that claims a road of a million kilometres must not take the machine down."""

_ROUNDING = 1e-8
"""Metres that a line may move by when points are left out."""


def _main(source: str, target: str) -> int:
    if Network is None:
        return 3
    if resource is not None:
        _, most = resource.getrlimit(resource.RLIMIT_AS)
        # whoever runs this may be allowed less
        soft = _MEMORY_BYTES if most == resource.RLIM_INFINITY else min(_MEMORY_BYTES, most)
        resource.setrlimit(resource.RLIMIT_AS, (soft, most))
    try:
        # Neither reads nor writes Scenic's own cache, which would lie beside the map.
        network: Any = Network.fromFile(source, useCache=False, writeCache=False)
        features = features_of(network, Directions(ElementTree.parse(source).getroot()))  # noqa: S314 - Scenic read it
    except Exception as error:  # noqa: BLE001 - whatever Scenic's parser stumbles over is the map's fault here
        sys.stderr.write("\n" + explain(error, source).replace("\n", " ") + "\n")
        return 4
    with open(target, "w", encoding="utf-8") as file:
        json.dump({"type": "FeatureCollection", "features": features}, file)
    return 0


class Directions:
    """Which way the lanes of a map run, as far as that is not what Scenic takes them to do.

    Attributes:
        left_hand: Roads, by id, on which traffic keeps to the left.
    """

    def __init__(self, root: ElementTree.Element) -> None:
        """Read the rules of roads and the directions of lanes."""
        self.left_hand = {road.get("id", "") for road in root.iter("road") if (road.get("rule") or "").upper() == "LHT"}
        self._turned: dict[tuple[str, int], bool] = {}
        for road in root.iter("road"):
            for lane in road.iter("lane"):
                name = lane.get("id") or ""
                if name.lstrip("-").isdigit() and (turned := self._turns(road, lane, int(name))) is not None:
                    self._turned.setdefault((road.get("id", ""), int(name)), turned)

    def _turns(self, road: ElementTree.Element, lane: ElementTree.Element, number: int) -> bool | None:
        """Whether a lane says that it runs otherwise than Scenic takes it to do; None if it says nothing."""
        direction = lane.get("direction")
        if direction in ("standard", "reversed"):
            return (direction == "reversed") != (road.get("id", "") in self.left_hand)
        if road.get("rule"):
            return None
        # so say the tools that made CARLA's maps, where the standard's own words are missing
        way = next((each.get("travelDir") for each in lane.iter("vectorLane")), None)
        return (way == "backward") != (number > 0) if way in ("forward", "backward") else None

    def turned(self, road: str, lane: int) -> bool:
        """Whether a lane, by its road and number, runs against what Scenic takes it to do."""
        return self._turned.get((road, lane), road in self.left_hand)


def explain(error: BaseException, source: str) -> str:
    """What Scenic's parser stumbled over: its own words, and the elements that it was at.

    Args:
        error: What it raised.
        source: The map.
    """
    if isinstance(error, ElementTree.ParseError):
        return f"it is not sound XML: {error}"
    words = str(error).replace(source, "the map")
    text = f"{type(error).__name__}: {words}" if words else type(error).__name__
    if at := list(dict.fromkeys(_elements_at(error))):
        text += f", at {', '.join(at[:3])}"
    return text


_CALLED = {"RoadLink": "the link of road", "Road": "road", "Junction": "junction", "Lane": "lane", "Signal": "signal"}
"""Scenic's classes that stand for an element, and what the element is called."""


def _elements_at(error: BaseException) -> Iterator[str]:
    """The elements that were worked on, the innermost first."""
    frames: list[Any] = []
    trace = error.__traceback__
    while trace is not None:
        frames.append(trace.tb_frame)
        trace = trace.tb_next
    for frame in reversed(frames):
        for value in frame.f_locals.values():
            if isinstance(value, ElementTree.Element) and value.get("id") is not None:
                yield f"{value.tag} `{value.get('id')}`"
            called = _CALLED.get(type(value).__name__)
            name = getattr(value, "id_", getattr(value, "id_a", None))
            if called is not None and name is not None:
                yield f"{called} `{name}`"


def features_of(network: Any, directions: Directions) -> list[dict[str, Any]]:
    """All elements of Scenic's network, those turned round that run otherwise."""

    def turned(lane: Any) -> bool:
        return directions.turned(str(lane.road.id), lane.sections[0].openDriveID)

    def keeps_left(element: Any) -> bool:
        return str(element.road.id) in directions.left_hand

    crossing_of: dict[str, str] = {}
    after: dict[str, list[str]] = {}
    for lane in network.lanes:
        for maneuver in lane.maneuvers:
            way = [part.uid for part in (lane, maneuver.connectingLane, maneuver.endLane) if part is not None]
            for here, there in pairwise(reversed(way) if turned(lane) else way):
                after.setdefault(here, []).append(there)
    for crossing in network.intersections:
        for maneuver in crossing.maneuvers:
            if maneuver.connectingLane is not None:
                crossing_of[maneuver.connectingLane.road.uid] = crossing.uid
    found = [_lane(lane, after, turned(lane), keeps_left(lane)) for lane in network.lanes]
    found += [
        _lane_section(section, turned(section.lane), keeps_left(section.lane)) for section in network.laneSections
    ]
    for group in network.laneGroups:
        found += _lane_group(group, turned(group.lanes[0]))
    for road in (*network.roads, *network.connectingRoads):
        found.append(_road(road, crossing_of.get(road.uid), keeps_left(road.lanes[0])))
        found += [_road_section(section, keeps_left(section)) for section in road.sections]
    found += [_intersection(crossing, turned) for crossing in network.intersections]
    found += [_feature(element, "crossing", {}) for element in network.crossings]
    for kind, elements in (("sidewalk", network.sidewalks), ("shoulder", network.shoulders)):
        for element in elements:
            left = keeps_left(element)
            links = {"road": element.road.uid, "centerline": _points(element.centerline, left)}
            found.append(_feature(element, kind, {**links, **_edges(element, left), **_ends(element, left)}))
    # without the cracks between elements, which Scenic closes here alone
    found.append(_shaped("drivable", "drivable", network.drivableRegion.polygons, {}))
    return found


def _lane(lane: Any, after: dict[str, list[str]], turned: bool, left_hand: bool) -> dict[str, Any]:
    links = {
        "group": _uid(lane.group),
        "road": _uid(lane.road),
        "successors": list(dict.fromkeys(after.get(lane.uid, []))),
        "traffic": "left" if left_hand else None,
        "centerline": _points(lane.centerline, turned),
    }
    # a lane that is not cut has the edges of its section, and this its centreline
    edges = _edges(lane, turned) if len(lane.sections) > 1 else {}
    return _feature(lane, "lane", {**links, **edges, **_ends(lane, turned)})


def _lane_section(section: Any, turned: bool, left_hand: bool) -> dict[str, Any]:
    sides = (section._laneToLeft, section._laneToRight)
    left, right = reversed(sides) if turned else sides
    links = {
        "lane": section.lane.uid,
        "left": _uid(left),
        "right": _uid(right),
        "number": section.openDriveID,
        "traffic": "left" if left_hand else None,
        "centerline": _points(section.centerline, turned) if len(section.lane.sections) > 1 else None,
    }
    return _feature(section, "lane_section", {**links, **_edges(section, turned), **_ends(section, turned)})


def _lane_group(group: Any, turned: bool) -> list[dict[str, Any]]:
    """A lane group and its curb."""
    links = {
        "road": group.road.uid,
        "opposite": _uid(group._opposite),
        "sidewalk": _listed(group._sidewalk),
        "shoulder": _listed(group._shoulder),
    }
    found = [_feature(group, "lane_group", {**links, **_ends(group, turned)})]
    if group.curb is not None:
        found.append(_shaped(f"{group.uid}_curb", "curb", group.curb.lineString, {"group": group.uid}))
    return found


def _road(road: Any, intersection: str | None, left_hand: bool) -> dict[str, Any]:
    directions = (_uid(road.forwardLanes), _uid(road.backwardLanes))
    forward, backward = reversed(directions) if left_hand else directions
    links = {
        "forward": forward,
        "backward": backward,
        "intersection": intersection,
        "signals": [_signal(signal) for signal in road.signals],
        "centerline": _points(road.centerline, left_hand),
    }
    return _feature(road, "road", {**links, **_ends(road, left_hand)})


def _road_section(section: Any, left_hand: bool) -> dict[str, Any]:
    directions = ([part.uid for part in section.forwardLanes], [part.uid for part in section.backwardLanes])
    forward, backward = reversed(directions) if left_hand else directions
    links = {
        "road": section.road.uid,
        "forward": forward,
        "backward": backward,
        "centerline": _points(section.centerline, left_hand),
    }
    return _feature(section, "road_section", {**links, **_ends(section, left_hand)})


def _intersection(crossing: Any, turned: Callable[[Any], bool]) -> dict[str, Any]:
    ways = [(each, turned(each.connectingLane)) for each in crossing.maneuvers]
    incoming = [each.endLane if back else each.startLane for each, back in ways]
    any_turned = any(back for _, back in ways)
    # lanes that end here and lead nowhere
    incoming += [] if any_turned else crossing.incomingLanes
    links = {
        "roads": [road.uid for road in crossing.roads],
        "incoming": list(dict.fromkeys(lane.uid for lane in incoming)),
        # where several lie in one direction from the middle, Scenic's order is that of rounding errors
        "outgoing": None if any_turned else [lane.uid for lane in crossing.outgoingLanes],
        "signalized": bool(crossing.isSignalized),
        "signals": [_signal(signal) for signal in crossing.signals],
    }
    return _feature(crossing, "intersection", links)


def _signal(signal: Any) -> dict[str, Any]:
    return {"id": signal.uid, "number": signal.openDriveID, "country": signal.country, "type": signal.type}


def _uid(element: Any) -> str | None:
    return None if element is None else element.uid


def _listed(element: Any) -> list[str]:
    """A reference that says also that there is none; Scenic leaves the number of a lane that it does not find."""
    return [] if element is None or isinstance(element, int) else [element.uid]


def _ends(element: Any, turned: bool) -> dict[str, list[str]]:
    """What lies before and behind an element; of one that is turned round, it follows from the ways of its lanes."""
    if turned:
        return {}
    return {"predecessor": _listed(element._predecessor), "successor": _listed(element._successor)}


def _edges(element: Any, backwards: bool) -> dict[str, Any]:
    """The sides of an element, along its direction."""
    sides = (element.leftEdge, element.rightEdge)
    left, right = reversed(sides) if backwards else sides
    return {"left_edge": _points(left, backwards), "right_edge": _points(right, backwards)}


def _points(region: Any, backwards: bool) -> list[list[list[float]]]:
    # points on straight pieces, of which some of Scenic's lines have many, say nothing
    lines = shapely.simplify(shapely.get_parts(region.lineString), _ROUNDING)
    if backwards:
        lines = [shapely.reverse(line) for line in reversed(lines)]
    return [shapely.get_coordinates(line).tolist() for line in lines]


def _feature(element: Any, kind: str, properties: dict[str, Any]) -> dict[str, Any]:
    own = {"name": element.name or None, "source_id": element.id if element.id != element.uid else None}
    return _shaped(element.uid, kind, element.polygon, {**own, **properties})


def _shaped(uid: str, kind: str, shape: Any, properties: dict[str, Any]) -> dict[str, Any]:
    flat = shapely.force_2d(shape)
    if not flat.is_valid:
        parts = [part for part in shapely.get_parts(shapely.make_valid(flat)) if part.area > 0 or kind == "curb"]
        flat = shapely.union_all(parts)
    given = {key: value for key, value in properties.items() if value is not None}
    return {"type": "Feature", "properties": {**given, "id": uid, "kind": kind}, "geometry": mapping(flat)}


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1], sys.argv[2]))
