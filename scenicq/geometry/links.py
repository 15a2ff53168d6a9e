"""How elements of a map hang together, as a relation: which element each attribute leads to.

It has the attributes that lead to one element at most. What they lead to is the same as in a network of the same
features; here it is a row, so that many maps can be asked at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from scenicq.geometry.elements import LaneSection, NetworkElement
from scenicq.geometry.features import MapFeature
from scenicq.geometry.network_builder import relate_elements

__all__ = ["DIRECTS", "IS_SECTION", "LINKS", "Link", "find_link", "links_of"]

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

_NEEDED = frozenset({"laneToLeft", "laneToRight", "fasterLane", "slowerLane", "opposite"})
"""Links that there is no scene without; with an underscore, they lead to None."""


class Link(NamedTuple):
    """A link of an element.

    Attributes:
        kind: The kind of the element.
        region: What its area is called.
        link: The attribute.
        target: What the area of the element is called that it leads to.
    """

    kind: str
    region: str
    link: str
    target: str


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
    elements = relate_elements(features)
    tables: Mapping[str, Mapping[str, Any]] = {
        "lane": elements.lanes,
        "lane_section": elements.sections,
        "lane_group": elements.groups,
        "road": elements.roads,
        "sidewalk": elements.sidewalks,
        "shoulder": elements.shoulders,
    }
    for kind, table in tables.items():
        for element in table.values():
            own = _region(element)
            if kind == "lane_section":
                yield Link(kind, own, IS_SECTION, own)
            for link in LINKS[kind]:
                target = getattr(element, f"_{link}" if link in _NEEDED else link)
                if target is not None:
                    yield Link(kind, own, link, _region(target))
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
