"""Scenic's road network as features of the interchange format, so that both sides use the same polygons."""

from __future__ import annotations

from typing import Any

from shapely.geometry import mapping

CRACK = 5e-4
"""Half of the metres between neighbouring sidewalks that Scenic closes."""


def _polylines(region: Any) -> list[list[list[float]]]:
    line = region.lineString
    return [[[point[0], point[1]] for point in part.coords] for part in getattr(line, "geoms", [line])]


def _name(element: Any) -> str | None:
    return None if element is None else element.uid


def _feature(element: Any, kind: str, **properties: Any) -> dict[str, Any]:
    known = {name: value for name, value in properties.items() if value not in (None, [])}
    return {
        "type": "Feature",
        "geometry": mapping(element.polygon.buffer(CRACK) if kind in ("sidewalk", "shoulder") else element.polygon),
        "properties": {"id": element.uid, "kind": kind, **known},
    }


def _curb(group: Any) -> dict[str, Any]:
    lines = _polylines(group.curb)
    return {
        "type": "Feature",
        "geometry": {"type": "MultiLineString", "coordinates": lines},
        "properties": {"id": f"{group.uid}-curb", "kind": "curb", "group": group.uid},
    }


def _identity(elements: Any) -> list[str]:
    return [element.uid for element in elements]


def features_of(network: Any) -> list[dict[str, Any]]:
    """Every element of a network of Scenic's driving domain."""
    inside = {road.uid: crossing.uid for crossing in network.intersections for road in _connecting(crossing)}
    # Scenic closes the cracks between its elements
    drivable = mapping(network.drivableRegion.polygons)
    whole = {"type": "Feature", "geometry": drivable, "properties": {"id": "drivable", "kind": "drivable"}}
    found = [
        whole,
        *(
            _feature(each, "intersection", roads=_identity(each.roads), signalized=bool(each.isSignalized))
            for each in network.intersections
        ),
    ]
    for road in network.allRoads:
        forward, backward = _name(road.forwardLanes), _name(road.backwardLanes)
        found.append(_feature(road, "road", forward=forward, backward=backward, intersection=inside.get(road.uid)))
    for group in network.laneGroups:
        found.append(_feature(group, "lane_group", road=group.road.uid, opposite=_name(group._opposite)))
    found += [_curb(group) for group in network.laneGroups]
    for lane in network.lanes:
        found.append(
            _feature(
                lane,
                "lane",
                centerline=_polylines(lane.centerline),
                road=lane.road.uid,
                group=lane.group.uid,
                predecessors=[lane._predecessor.uid] if lane._predecessor else [],
                successors=_successors(lane),
            )
        )
        for part in lane.sections:
            left, right = _name(part._laneToLeft), _name(part._laneToRight)
            line = _polylines(part.centerline)
            found.append(_feature(part, "lane_section", lane=lane.uid, centerline=line, left=left, right=right))
    for kind, elements in (("sidewalk", network.sidewalks), ("shoulder", network.shoulders)):
        found += [_feature(each, kind, centerline=_polylines(each.centerline)) for each in elements]
    return found + [_feature(each, "crossing") for each in network.crossings]


def _successors(lane: Any) -> list[str]:
    """The lanes that one leads to, Scenic's own successor first."""
    turns = [maneuver.connectingLane for maneuver in lane.maneuvers if maneuver.connectingLane]
    return list(dict.fromkeys(each.uid for each in (lane._successor, *turns) if each))


def _connecting(crossing: Any) -> list[Any]:
    return [maneuver.connectingLane.road for maneuver in crossing.maneuvers if maneuver.connectingLane]
