"""Lanelet2 maps (OSM XML) as map features.

Nodes have latitude and longitude, which a UTM projection about the origin (0, 0) takes to metres, as the tools of the
INTERACTION dataset do. The lines of a lanelet may run against it: its direction is the one in which the left line lies
left. Neighbours share a line, successors start at the points where a lanelet ends. What is not read is counted
(`specifications/lanelet2.json`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from shapely.geometry import Polygon

from scenicq.geometry.features import MapFeature, ProblemSink
from scenicq.importers.fields import InvalidError
from scenicq.importers.lane_graph import BoundedLane, lane_features, sound_area
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification
from scenicq.importers.xml_tree import attribute, read_xml

__all__ = ["read_lanelets", "utm"]

_AREAS = {"crosswalk": "crossing", "walkway": "sidewalk", "shared_walkway": "sidewalk", "stairs": "stairs"}
_SIDES = ("left", "right")
_MERIDIAN_DEG = 3.0
"""Central meridian of the zone that holds longitude 0."""

_Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class _Lanelet:
    """Node ids of its lines, in the direction of travel."""

    id: str
    left: tuple[str, ...]
    right: tuple[str, ...]
    tags: Mapping[str, str]


def read_lanelets(path: Path, on_problem: ProblemSink, report: Report) -> tuple[MapFeature, ...]:
    """Read a map.

    Args:
        path: The `.osm` file.
        on_problem: Called with the id of a lanelet and what is wrong with it.
        report: Takes counts of what is not read.

    Raises:
        DataError: `file-missing` or `file-invalid`.
    """
    root = read_xml(path)
    _count(root, report)
    places = _places(root, on_problem)
    ways = {way.get("id", ""): tuple(nd.get("ref", "") for nd in way.iter("nd")) for way in root.iter("way")}
    lanes: list[_Lanelet] = []
    areas: list[MapFeature] = []
    seen: set[str] = set()
    for relation in root.iter("relation"):
        tags = _tags(relation)
        if tags.get("type") != "lanelet":
            continue
        name = relation.get("id", "")
        try:
            if attribute(relation, "id") in seen:
                raise InvalidError("the id is used twice")
            seen.add(name)
            lanelet = _lanelet(name, relation, ways, places, tags)
            kind = _AREAS.get(tags.get("subtype", ""))
            if kind is None:
                lanes.append(lanelet)
            else:
                outline = [places[node] for node in (*lanelet.left, *reversed(lanelet.right))]
                areas.append(MapFeature(name, kind, sound_area(Polygon(outline)), {"subtype": tags["subtype"]}))
        except (InvalidError, ValueError) as error:
            on_problem(name, str(error))
    return (*lane_features(_linked(lanes, places), on_problem), *areas)


def _count(root: Element, report: Report) -> None:
    """Count what is left out: the format says kinds in tags and roles, not in names of elements."""
    known = load_specification("lanelet2")
    lanelets = [each for each in root.iter("relation") if _tags(each).get("type") == "lanelet"]
    sides = {member.get("ref") for each in lanelets for member in each.iter("member") if member.get("role") in _SIDES}
    for name in root.attrib:
        known.count(f"@{name}", report)
    for element in root:
        path = element.tag
        tags = _tags(element)
        if path == "relation":
            path = f"relation/{tags.get('type', 'of no type')}"
        elif path == "way" and element.get("id") not in sides:
            path = f"way_of_no_lanelet/{tags.get('type', 'of no type')}"
        if not known.count(path, report):
            continue
        if path == "relation/lanelet" and tags.get("one_way") == "no" and tags.get("subtype") not in _AREAS:
            report.count_unread('relation/lanelet/tag/one_way="no": the other direction')
        inner = [f"@{name}" for name in element.attrib]
        inner += [
            f"tag/{child.get('k')}"
            if child.tag == "tag"
            else f"member/{child.get('role')}"
            if child.tag == "member"
            else child.tag
            for child in element
        ]
        known.count_columns(path, inner, report)


def utm(latitude: float, longitude: float) -> _Place:
    """Metres east and north of latitude and longitude 0, on the transverse Mercator of the zone there (WGS 84).

    The series of Krüger, to the fourth power of the third flattening: exact to a millimetre within the zone.
    """
    east, north = _transverse(math.radians(latitude), math.radians(longitude - _MERIDIAN_DEG))
    east_0, north_0 = _transverse(0.0, math.radians(-_MERIDIAN_DEG))
    return east - east_0, north - north_0


def _transverse(latitude: float, longitude: float) -> _Place:
    flattening = 1 / 298.257223563
    n = flattening / (2 - flattening)
    radius = 6378137.0 / (1 + n) * (1 + n**2 / 4 + n**4 / 64)
    series = (
        n / 2 - 2 * n**2 / 3 + 5 * n**3 / 16 + 41 * n**4 / 180,
        13 * n**2 / 48 - 3 * n**3 / 5 + 557 * n**4 / 1440,
        61 * n**3 / 240 - 103 * n**4 / 140,
        49561 * n**4 / 161280,
    )
    eccentricity = 2 * math.sqrt(n) / (1 + n)
    sine = math.sin(latitude)
    conformal = math.sinh(math.atanh(sine) - eccentricity * math.atanh(eccentricity * sine))
    xi = math.atan2(conformal, math.cos(longitude))
    eta = math.asinh(math.sin(longitude) / math.hypot(conformal, math.cos(longitude)))
    north, east = xi, eta
    for j, factor in enumerate(series, start=1):
        north += factor * math.sin(2 * j * xi) * math.cosh(2 * j * eta)
        east += factor * math.cos(2 * j * xi) * math.sinh(2 * j * eta)
    return 0.9996 * radius * east, 0.9996 * radius * north


def _places(root: Element, on_problem: ProblemSink) -> dict[str, _Place]:
    places: dict[str, _Place] = {}
    for node in root.iter("node"):
        try:
            latitude, longitude = (_degrees(node, name) for name in ("lat", "lon"))
            if not (abs(latitude) < 84 and abs(longitude - _MERIDIAN_DEG) < 30):
                raise InvalidError("its place is outside of the zone of the projection")
            places[attribute(node, "id")] = utm(latitude, longitude)
        except ValueError as error:
            on_problem(node.get("id", ""), f"node: {error}")
    return places


def _degrees(node: Element, name: str) -> float:
    text = attribute(node, name)
    try:
        return float(text)
    except ValueError:
        raise InvalidError(f"`{name}` is not a number but `{text[:40]}`") from None


def _tags(relation: Element) -> dict[str, str]:
    return {tag.get("k", ""): tag.get("v", "") for tag in relation.findall("tag")}


def _lanelet(
    name: str,
    relation: Element,
    ways: Mapping[str, tuple[str, ...]],
    places: Mapping[str, _Place],
    tags: Mapping[str, str],
) -> _Lanelet:
    sides: dict[str, tuple[str, ...]] = {}
    for member in relation.findall("member"):
        role = member.get("role", "")
        if role in _SIDES and member.get("type") == "way":
            nodes = tuple(node for node in ways.get(member.get("ref", ""), ()) if node in places)
            if role in sides:
                raise InvalidError(f"its {role} side has several lines")
            sides[role] = nodes
    left, right = sides.get("left", ()), sides.get("right", ())
    if min(len(left), len(right)) < 2:
        raise InvalidError("a side is missing or has fewer than two points")

    def apart(a: str, b: str) -> float:
        return math.dist(places[a], places[b])

    if apart(left[0], right[0]) + apart(left[-1], right[-1]) > apart(left[0], right[-1]) + apart(left[-1], right[0]):
        right = right[::-1]
    if _signed_area([places[node] for node in (*left, *reversed(right))]) > 0:
        left, right = left[::-1], right[::-1]
    return _Lanelet(name, left, right, tags)


def _signed_area(outline: list[_Place]) -> float:
    """Positive where the outline runs counter-clockwise."""
    pairs = zip(outline, outline[1:] + outline[:1], strict=True)
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs)


def _linked(lanelets: list[_Lanelet], places: Mapping[str, _Place]) -> list[BoundedLane]:
    by_left = {lanelet.left: lanelet.id for lanelet in lanelets}
    by_right = {lanelet.right: lanelet.id for lanelet in lanelets}
    starts: dict[tuple[str, str], list[str]] = {}
    ends: dict[tuple[str, str], list[str]] = {}
    for lanelet in lanelets:
        starts.setdefault((lanelet.left[0], lanelet.right[0]), []).append(lanelet.id)
        ends.setdefault((lanelet.left[-1], lanelet.right[-1]), []).append(lanelet.id)
    made: list[BoundedLane] = []
    for lanelet in lanelets:
        left, left_turned = by_right.get(lanelet.left), by_left.get(lanelet.left[::-1])
        right, right_turned = by_left.get(lanelet.right), by_right.get(lanelet.right[::-1])
        made.append(
            BoundedLane(
                id=lanelet.id,
                left=np.array([places[node] for node in lanelet.left]),
                right=np.array([places[node] for node in lanelet.right]),
                beside_left=left or left_turned,
                beside_right=right or right_turned,
                left_is_opposite=left is None,
                right_is_opposite=right is None,
                predecessors=tuple(ends.get((lanelet.left[0], lanelet.right[0]), ())),
                successors=tuple(starts.get((lanelet.left[-1], lanelet.right[-1]), ())),
                in_intersection="turn_direction" in lanelet.tags,
                properties={key: lanelet.tags[key] for key in ("subtype", "one_way") if key in lanelet.tags},
            )
        )
    return made
