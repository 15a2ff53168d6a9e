"""The heading that a place on the map brings with it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.forest.bounds import scalar_bounds
from scenicq.forest.nodes import Constant, DirectionAt, Node, Range, Select
from scenicq.forest.walk import postorder
from scenicq.geometry.default_street import street
from scenicq.geometry.network import Network

MODEL = "model scenic.domains.driving.model\nego = new Car\n"


def heading_of_the_last(text: str) -> Node:
    scenario = compile_scenario(Source("test.scenic", MODEL + text), street())
    return scenario.objects[-1].properties["heading"].value


@pytest.mark.parametrize(
    "place",
    [
        "sidewalk",
        "crossing",
        "Uniform(*network.sidewalks)",
        "visible sidewalk",
        "Uniform(*network.roads).sidewalkRegion",
        "network.roads[0].sidewalkRegion",
    ],
)
def test_where_the_map_gives_no_direction_it_is_any(place: str) -> None:
    heading = heading_of_the_last(
        f"spot = new OrientedPoint on {place}\nnew Object at spot, facing 0 relative to spot\n"
    )
    assert {type(node) for node in postorder([heading]) if isinstance(node, Range | DirectionAt)} == {Range}
    assert scalar_bounds(heading) == pytest.approx((-math.pi, math.pi))


@pytest.mark.parametrize("place", ["sidewalk", "network.roads[0].sidewalkRegion", "network.sidewalks[0]"])
def test_what_is_said_of_the_road_is_not_asked_where_the_map_gives_another_direction(place: str) -> None:
    features = [
        replace(each, properties={**each.properties, "centerline": [[[9.0, -40.0], [9.0, 40.0]]]})
        if each.kind == "sidewalk"
        else each
        for each in street().features
    ]
    text = f"{MODEL}new Car in {place}, with roadDeviation 90 deg\n"
    scenario = compile_scenario(Source("test.scenic", text), Network("walks", features))
    heading = scenario.objects[-1].properties["heading"].value
    fields = [node.field for node in postorder([heading]) if isinstance(node, DirectionAt)]
    assert fields
    assert all(isinstance(field, Constant) and field.value.name != street().roadDirection.name for field in fields)
    assert not any(
        isinstance(node, Constant) and node.value == pytest.approx(math.pi / 2) for node in postorder([heading])
    )


def test_on_the_road_it_is_that_of_traffic() -> None:
    heading = heading_of_the_last("spot = new OrientedPoint on road\nnew Object at spot, facing 0 relative to spot\n")
    assert [type(node) for node in postorder([heading]) if isinstance(node, Range | DirectionAt)] == [DirectionAt]


@pytest.mark.parametrize(
    ("place", "either"),
    [("ego.laneGroup.opposite", True), ("visible ego.laneGroup.opposite", True), ("ego.lane", False), ("road", False)],
)
def test_what_lies_on_a_part_that_some_elements_lack_has_either_heading(place: str, either: bool) -> None:
    heading = heading_of_the_last(f"new Pedestrian on {place}\n")
    found = {type(node) for node in postorder([heading]) if isinstance(node, Range | DirectionAt)}
    assert found == ({Range, DirectionAt} if either else {DirectionAt})


@pytest.mark.parametrize(("place", "either"), [("ego.laneGroup.opposite", True), ("ego.laneGroup", False)])
@pytest.mark.parametrize("found", ["network.laneAt(before)", "network.laneAt(spot)", "network.laneGroupAt(after)"])
def test_so_has_what_is_looked_up_where_such_a_part_is(place: str, found: str, either: bool) -> None:
    text = f"before = new Car on {place}\nspot = new Point on {place}\nafter = new Car on network.laneAt(before)\n"
    heading = heading_of_the_last(f"{text}new Pedestrian on {found}\n")
    assert any(isinstance(node, Range) for node in postorder([heading])) is either


@pytest.mark.parametrize("base", ["ego.lane.centerline", "network.lanes[0].centerline", "network.lanes[0].leftEdge"])
@pytest.mark.parametrize("taken", ["intersection", "CircularRegion((0, 0), 4)", "ego.laneSection"])
@pytest.mark.parametrize("more", ["", ".intersect(road)", ".difference(sidewalk)"])
@pytest.mark.one_in(9)
def test_lines_that_something_is_taken_off_have_either_heading(base: str, taken: str, more: str) -> None:
    for made, either in ((f"{base}.difference({taken}){more}", True), (f"{base}.intersect(road)", False)):
        nodes = postorder([heading_of_the_last(f"new Car on {made}\n")])
        fields = [node.field for node in nodes if isinstance(node, DirectionAt)]
        known = {field.value.name for field in fields if isinstance(field, Constant)}
        assert (street().roadDirection.name in known) is either, made
        assert len(fields) > either, made


def test_what_a_part_that_some_elements_lack_gives_and_what_the_class_says_are_both_directions() -> None:
    heading = heading_of_the_last("new Car on ego.laneGroup.opposite\n")
    nodes = list(postorder([heading]))
    fields = [node.field for node in nodes if isinstance(node, DirectionAt)]
    assert any(isinstance(field, Select) for field in fields), "that of the group"
    traffic = street().roadDirection.name
    assert any(isinstance(field, Constant) and field.value.name == traffic for field in fields), "that of traffic"
    assert not any(isinstance(node, Range) for node in nodes)
