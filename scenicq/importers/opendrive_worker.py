"""Runs in a process of its own, started by `opendrive`: an OpenDRIVE file in, interchange GeoJSON out.

Usage: `python opendrive_worker.py MAP.xodr MAP.geojson`. It imports nothing of this package, so the Python that runs it
only needs Scenic. Exit codes: 0 done, 3 Scenic is missing, 4 Scenic cannot read the map (the last line on stderr says
why).
"""

# Scenic has no type stubs.
# pyright: reportMissingImports=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false, reportMissingTypeStubs=false

from __future__ import annotations

import json
import sys
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

__all__: list[str] = []

_MEMORY_BYTES = 8 << 30
"""A map that claims a road of a million kilometres must not take the machine down."""


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
    except Exception as error:  # noqa: BLE001 - whatever Scenic's parser stumbles over is the map's fault here
        sys.stderr.write(f"\n{type(error).__name__}: {error}".replace("\n", " ") + "\n")
        return 4
    features = _features(network, _keeps_left(source))
    with open(target, "w", encoding="utf-8") as file:
        json.dump({"type": "FeatureCollection", "features": features}, file)
    return 0


def _features(network: Any, left_hand: bool) -> list[dict[str, Any]]:
    crossing_of: dict[str, str] = {}
    after: dict[str, list[str]] = {}
    for lane in network.lanes:
        for maneuver in lane.maneuvers:
            way = [part.uid for part in (lane, maneuver.connectingLane, maneuver.endLane) if part is not None]
            for here, there in pairwise(reversed(way) if left_hand else way):
                after.setdefault(here, []).append(there)
    for crossing in network.intersections:
        for maneuver in crossing.maneuvers:
            if maneuver.connectingLane is not None:
                crossing_of[maneuver.connectingLane.road.uid] = crossing.uid
    found = [_lane(lane, after, left_hand) for lane in network.lanes]
    found += [_section(section, left_hand) for section in network.laneSections]
    for group in network.laneGroups:
        links = {"road": group.road.uid, "opposite": _uid(group._opposite)}
        found.append(_feature(group.uid, "lane_group", group.polygon, links))
        if group.curb is not None:
            found.append(_feature(f"{group.uid}_curb", "curb", _line(group.curb), {"group": group.uid}))
    for road in (*network.roads, *network.connectingRoads):
        directions = (_uid(road.forwardLanes), _uid(road.backwardLanes))
        forward, backward = reversed(directions) if left_hand else directions
        links = {"forward": forward, "backward": backward}
        links["intersection"] = crossing_of.get(road.uid)
        found.append(_feature(road.uid, "road", road.polygon, links))
    for crossing in network.intersections:
        links = {"roads": [road.uid for road in crossing.roads], "signalized": bool(crossing.isSignalized)}
        found.append(_feature(crossing.uid, "intersection", crossing.polygon, links))
    found += [_feature(element.uid, "crossing", element.polygon, {}) for element in network.crossings]
    for kind, elements in (("sidewalk", network.sidewalks), ("shoulder", network.shoulders)):
        for element in elements:
            links = {"centerline": _points(element.centerline, left_hand)}
            found.append(_feature(element.uid, kind, element.polygon, links))
    return found


def _lane(lane: Any, after: dict[str, list[str]], left_hand: bool) -> dict[str, Any]:
    links = {
        "group": _uid(lane.group),
        "road": _uid(lane.road),
        "successors": list(dict.fromkeys(after.get(lane.uid, []))),
        "traffic": "left" if left_hand else None,
        "centerline": _points(lane.centerline, left_hand),
    }
    return _feature(lane.uid, "lane", lane.polygon, links)


def _section(section: Any, left_hand: bool) -> dict[str, Any]:
    sides = (section._laneToLeft, section._laneToRight)
    left, right = reversed(sides) if left_hand else sides
    links = {
        "lane": section.lane.uid,
        "left": _uid(left),
        "right": _uid(right),
        "traffic": "left" if left_hand else None,
        "centerline": _points(section.centerline, left_hand),
    }
    return _feature(section.uid, "lane_section", section.polygon, links)


def _keeps_left(source: str) -> bool:
    """Whether the map says that traffic keeps to the left.

    Scenic 3.1.1 does not read that, and takes all traffic to keep to the right: every lane runs the wrong way then.
    """
    roads = ElementTree.parse(source).iter("road")  # noqa: S314 - Scenic has read it the same way before
    return any((road.get("rule") or "").upper() == "LHT" for road in roads)


def _uid(element: Any) -> str | None:
    return None if element is None else element.uid


def _line(region: Any) -> Any:
    return region.lineString


def _points(region: Any, backwards: bool) -> list[list[list[float]]]:
    lines = shapely.get_parts(region.lineString)
    if backwards:
        lines = [shapely.reverse(line) for line in reversed(lines)]
    return [shapely.get_coordinates(line).tolist() for line in lines]


def _feature(uid: str, kind: str, shape: Any, properties: dict[str, Any]) -> dict[str, Any]:
    flat = shapely.force_2d(shape)
    if not flat.is_valid:
        parts = [part for part in shapely.get_parts(shapely.make_valid(flat)) if part.area > 0 or kind == "curb"]
        flat = shapely.union_all(parts)
    given = {key: value for key, value in properties.items() if value is not None}
    return {"type": "Feature", "properties": {**given, "id": uid, "kind": kind}, "geometry": mapping(flat)}


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1], sys.argv[2]))
