"""Lanelets of CommonRoad as map features: boundaries run in driving direction, types say what is no lane."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree.ElementTree import Element

import numpy as np
from shapely.geometry import Polygon

from scenicq.geometry.features import MapFeature, ProblemSink
from scenicq.importers.fields import InvalidError
from scenicq.importers.lane_graph import BoundedLane, Points, lane_features, sound_area
from scenicq.importers.xml_tree import attribute, number

__all__ = ["lanelet_features"]

_AREAS = {"crosswalk": "crossing", "sidewalk": "sidewalk"}
_THROUGH = ("successorsRight", "successorsStraight", "successorsLeft")


def lanelet_features(root: Element, on_problem: ProblemSink) -> tuple[MapFeature, ...]:
    """The map of a scenario.

    Args:
        root: `commonRoad`.
        on_problem: Called with the id of a lanelet and what is wrong with it.
    """
    crossed = {
        link.get("ref", "")
        for intersection in root.iter("intersection")
        for name in _THROUGH
        for link in intersection.iter(name)
    }
    lanes: dict[str, BoundedLane] = {}
    areas: dict[str, MapFeature] = {}
    for element in root.findall("lanelet"):
        name = element.get("id", "")
        try:
            attribute(element, "id")
            if name in lanes or name in areas:
                raise InvalidError("the id is used twice")
            types = [kind.text or "" for kind in element.findall("laneletType")]
            area = next((_AREAS[kind] for kind in types if kind in _AREAS), None)
            left, right = _bound(element, "leftBound"), _bound(element, "rightBound")
            if area is None:
                lanes[name] = _lane(name, element, left, right, types, name in crossed)
            else:
                shape = sound_area(Polygon(np.concatenate([left, right[::-1]])))
                areas[name] = MapFeature(name, area, shape, {"lanelet_type": types[0]})
        except (InvalidError, ValueError) as error:
            on_problem(name, str(error))
    return (*lane_features(list(lanes.values()), on_problem), *areas.values())


def _lane(name: str, element: Element, left: Points, right: Points, types: Iterable[str], crossed: bool) -> BoundedLane:
    beside_left, beside_right = element.find("adjacentLeft"), element.find("adjacentRight")
    return BoundedLane(
        id=name,
        left=left,
        right=right,
        beside_left=None if beside_left is None else beside_left.get("ref"),
        beside_right=None if beside_right is None else beside_right.get("ref"),
        left_is_opposite=beside_left is not None and beside_left.get("drivingDir") == "opposite",
        right_is_opposite=beside_right is not None and beside_right.get("drivingDir") == "opposite",
        predecessors=_references(element, "predecessor"),
        successors=_references(element, "successor"),
        in_intersection=crossed or "intersection" in types,
        properties={"lane_type": kind} if (kind := next(iter(types), "")) else {},
    )


def _references(element: Element, name: str) -> tuple[str, ...]:
    return tuple(ref for link in element.findall(name) if (ref := link.get("ref")))


def _bound(element: Element, name: str) -> Points:
    points = [(number(point, "x"), number(point, "y")) for point in element.findall(f"{name}/point")]
    if len(points) < 2:
        raise InvalidError(f"`{name}` has fewer than two points")
    return np.array(points)
