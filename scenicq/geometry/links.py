"""The links between elements of a map, as rows: an element, an attribute, and an element that it leads to.

It has the attributes that lead to one element at most, those that are lists of elements, and the lanes ahead of each
lane. What they lead to is the same as in a network of the same features; here each is a row, so that many maps can be
asked at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from scenicq.geometry.elements import LaneSection, NetworkElement
from scenicq.geometry.features import MapFeature
from scenicq.geometry.lanes_ahead import lanes_from
from scenicq.geometry.network_builder import link as link_elements

__all__ = ["AHEAD", "AHEAD_M", "DIRECTS", "IS_SECTION", "LINKS", "LISTS", "Link", "find_link", "links_of"]

AHEAD = "lanesAhead"
"""The link from each lane to itself and to the lanes that it leads to; `Link.begins` says how far ahead."""

AHEAD_M = 100.0
"""Metres from a lane's end within which a lane ahead must begin. Programs that ask for more read every map."""

DIRECTS = "directs"
"""The link from a lane to the group or road that contains it and takes its direction there."""

IS_SECTION = "section"
"""The link from each lane section to itself. An uncut lane is its own only section, under the name of the lane."""

LINKS: Mapping[str, Mapping[str, str]] = {
    "lane": {"group": "lane_group", "road": "road"},
    "lane_section": {
        "lane": "lane",
        "group": "lane_group",
        "road": "road",
        "laneToLeft": "lane_section",
        "laneToRight": "lane_section",
        "fasterLane": "lane_section",
        "slowerLane": "lane_section",
    },
    "lane_group": {"road": "road", "opposite": "lane_group"},
    "road": {"intersection": "intersection"},
    "sidewalk": {"road": "road"},
    "shoulder": {"road": "road"},
}
"""By kind of element: the attributes that lead to one element at most, each with the kind of its target."""

LISTS: Mapping[str, Mapping[str, str]] = {
    "lane": {"successors": "lane", "predecessors": "lane", "adjacentLanes": "lane", "sections": "lane_section"},
    "lane_section": {"adjacentLanes": "lane_section"},
    "lane_group": {"lanes": "lane"},
    "road": {"lanes": "lane"},
    "intersection": {"lanes": "lane", "incomingLanes": "lane", "outgoingLanes": "lane", "roads": "road"},
}
"""By kind of element: the attributes that are lists, each with the kind of its items. Each item has a link."""

_NEEDED = frozenset({"laneToLeft", "laneToRight", "fasterLane", "slowerLane", "opposite"})
"""Links whose absence excludes the scene. The attribute with an underscore is None there instead."""


class Link(NamedTuple):
    """A link of an element.

    Attributes:
        kind: The kind of the element.
        region: What its area is called.
        link: The attribute.
        target: What the area of the element is called that it leads to.
        begins: How many metres behind the end of the first a lane ahead begins; None of other links.
    """

    kind: str
    region: str
    link: str
    target: str
    begins: float | None = None


def find_link(kind: str, attribute: str) -> tuple[str, bool] | None:
    """Find the link that an attribute reads, and whether scenes without its target are excluded.

    Args:
        kind: The kind.
        attribute: As programs write it.

    Returns:
        None of any other attribute.
    """
    link = attribute.removeprefix("_")
    known = link in LINKS.get(kind, {}) and (link in _NEEDED or link == attribute)
    return (link, link in _NEEDED and link == attribute) if known else None


def links_of(features: Sequence[MapFeature]) -> Iterator[Link]:
    """The links of a map.

    Args:
        features: Its elements, with unique ids.
    """
    elements = link_elements(features)
    tables: Mapping[str, Mapping[str, Any]] = {
        "lane": elements.lanes,
        "lane_section": elements.sections,
        "lane_group": elements.groups,
        "road": elements.roads,
        "sidewalk": elements.sidewalks,
        "shoulder": elements.shoulders,
        "intersection": elements.intersections,
    }
    for kind, table in tables.items():
        for element in table.values():
            own = _region(element)
            if kind == "lane_section":
                yield Link(kind, own, IS_SECTION, own)
            for link in LINKS.get(kind, ()):
                target = getattr(element, f"_{link}" if link in _NEEDED else link)
                if target is not None:
                    yield Link(kind, own, link, _region(target))
            for link in LISTS.get(kind, ()):
                for target in dict.fromkeys(getattr(element, link)):
                    yield Link(kind, own, link, _region(target))
    for lane in elements.lanes.values():
        for target, begins in lanes_from(lane, AHEAD_M).items():
            yield Link("lane", lane.id, AHEAD, target.id, begins)
    # of several groups that are one to a road that one has the direction
    directed = {group.id for road in elements.roads.values() for group in road.laneGroups}
    groups = (group for group in elements.groups.values() if group.road is None or group.id in directed)
    for element in (*groups, *elements.roads.values()):
        for lane in element.lanes:
            yield Link("lane", lane.id, DIRECTS, element.id)


def _region(element: NetworkElement) -> str:
    """The name of an element's region. The only section of an uncut lane has the region of the lane."""
    if isinstance(element, LaneSection) and element.properties is element.lane.properties:
        return element.lane.id
    return element.id
