"""How the elements of a map hang together is what its network says, attribute by attribute."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from scenicq.geometry.default_street import street
from scenicq.geometry.features import MapFeature, read_geojson
from scenicq.geometry.lanes_ahead import lanes_from
from scenicq.geometry.links import AHEAD, AHEAD_M, DIRECTS, IS_SECTION, LINKS, LISTS, find_link, links_of
from scenicq.geometry.network import Network

SAMPLES = Path(__file__).parents[3] / "sample_data"
KINDS = {
    "lane": "lanes",
    "lane_section": "laneSections",
    "lane_group": "laneGroups",
    "road": "allRoads",
    "sidewalk": "sidewalks",
    "shoulder": "shoulders",
    "intersection": "intersections",
}


def _maps() -> dict[str, tuple[MapFeature, ...]]:
    files = sorted(SAMPLES.rglob("*.geojson"))
    found = {file.stem: read_geojson(file, lambda *_: None) for file in files}
    return {"street": street().features, **found}


MAPS = _maps()


def _area(network: Network, element: object) -> str:
    """The feature that has an element's area."""
    ids = {feature.id for feature in network.features}
    return element.id if element.id in ids else element.lane.id


@pytest.mark.parametrize("name", MAPS)
def test_links_are_what_the_network_says(name: str):
    network = Network(name, MAPS[name])
    found = set(links_of(network.features))
    expected = set()
    for kind, listed in KINDS.items():
        for element in getattr(network, listed):
            for link, target in LISTS.get(kind, {}).items():
                for there in getattr(element, link):
                    expected.add((kind, _area(network, element), link, _area(network, there)))
                    assert there in getattr(network, KINDS[target])
            for link, target in LINKS.get(kind, {}).items():
                there = getattr(element, f"_{link}" if hasattr(element, f"_{link}") else link)
                if there is not None:
                    expected.add((kind, _area(network, element), link, _area(network, there)))
                    assert there in getattr(network, KINDS[target])
            if kind == "lane_section":
                expected.add((kind, _area(network, element), IS_SECTION, _area(network, element)))
    assert {each[:4] for each in found if each.link not in (DIRECTS, AHEAD)} == expected
    assert all((each.begins is not None) is (each.link == AHEAD) for each in found)
    assert len(found) == len(list(links_of(network.features)))


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("distance", [0.0, 3.0, 20.0, AHEAD_M])
def test_lanes_ahead_begin_where_those_on_the_way_end(name: str, distance: float):
    """A depth-first walk along all ways, however long, says what the shortest way is."""
    network = Network(name, MAPS[name])
    found = {(each.region, each.target): each.begins for each in links_of(network.features) if each.link == AHEAD}
    for lane in network.lanes:
        ahead: dict[str, float] = {lane.id: 0.0}
        todo = [(each, 0.0) for each in lane.successors]
        while todo:
            each, begins = todo.pop()
            if begins <= distance and begins < ahead.get(each.id, math.inf):
                ahead[each.id] = begins
                end = begins + sum(line.length for line in each.centerline.lines)
                todo += [(after, end) for after in each.successors]
        mine = {target: begins for (region, target), begins in found.items() if region == lane.id}
        assert {target: begins for target, begins in mine.items() if begins <= distance} == pytest.approx(ahead)
        assert {each.id for each in lanes_from(lane, distance)} == ahead.keys()


@pytest.mark.parametrize("name", MAPS)
def test_lanes_direct_what_has_their_direction(name: str):
    network = Network(name, MAPS[name])
    directed: dict[str, set[str]] = {}
    for each in links_of(network.features):
        if each.link == DIRECTS:
            directed.setdefault(each.target, set()).add(each.region)
    for element in (*network.laneGroups, *network.allRoads):
        if element.id in directed:
            assert {lane.id for lane in element.lanes} == directed[element.id]
            areas = {each.area.wkb for each in element.orientation.lanes} if element.orientation else set()
            assert {lane.polygon.wkb for lane in element.lanes if lane.orientation is not None} == areas


@pytest.mark.parametrize(
    ("kind", "attribute", "found"),
    [
        ("lane", "group", ("group", False)),
        ("lane", "_group", None),
        ("lane", "laneToLeft", None),
        ("lane_section", "laneToLeft", ("laneToLeft", True)),
        ("lane_section", "_laneToLeft", ("laneToLeft", False)),
        ("lane_group", "opposite", ("opposite", True)),
        ("lane_group", "lanes", None),
        ("crossing", "road", None),
    ],
)
def test_attributes_are_links(kind: str, attribute: str, found: tuple[str, bool] | None):
    assert find_link(kind, attribute) == found
