"""How elements of a map hang together, as a relation: which elements each attribute leads to.

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
"""The link from each lane to itself and the lanes that it leads to, with how far behind its end each begins."""

AHEAD_M = 100.0
"""Metres up to which lanes ahead are linked; programs that ask for more read every map."""

DIRECTS = "directs"
"""The link from each lane to a group or road that has the direction of the lane where it is in the lane."""

IS_SECTION = "section"
"""The link from each lane section to itself: a lane that the map does not cut is its own, and has no other name."""

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
"""For each kind of elements the links that start there, each with the kind that it leads to."""

LISTS: Mapping[str, Mapping[str, str]] = {
    "lane": {"successors": "lane", "predecessors": "lane", "adjacentLanes": "lane", "sections": "lane_section"},
    "lane_section": {"adjacentLanes": "lane_section"},
    "lane_group": {"lanes": "lane"},
    "road": {"lanes": "lane"},
    "intersection": {"lanes": "lane", "incomingLanes": "lane", "outgoingLanes": "lane", "roads": "road"},
}
"""For each kind of elements the lists that they have, each with the kind of what is in it: a link to each of these."""

_NEEDED = frozenset({"laneToLeft", "laneToRight", "fasterLane", "slowerLane", "opposite"})
"""Links that there is no scene without; with an underscore, they lead to None."""


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
    """The link that an attribute of the elements of a kind is, and whether there is no scene where there is none.

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
    """What the map calls an element's area: that of a lane that is not cut is that of its only section, too."""
    if isinstance(element, LaneSection) and element.properties is element.lane.properties:
        return element.lane.id
    return element.id
