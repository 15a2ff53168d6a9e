"""Lists of elements, and what lies before, behind and beside them, in Scenic's order."""

from __future__ import annotations

import math
from typing import Any

import pytest
from shapely.geometry import LineString, Point

from scenicq.compiler.attributes import attribute
from scenicq.compiler.interpreter import Interpreter
from scenicq.errors import ScenarioError, Source, Span
from scenicq.forest.nodes import Constant
from scenicq.geometry.elements import Intersection, Lane
from scenicq.geometry.features import MapFeature, dangling
from scenicq.geometry.network import Network

TOLD_OUTGOING = ["w-out", "n-out", "s-out", "e-out"]
"""An order of lanes away from an intersection that is none of headings."""
SPAN = Span(Source("no program", ""), 0, 0)


def lane(name: str, line: list[tuple[float, float]], **properties: Any) -> MapFeature:
    return MapFeature(
        name,
        "lane",
        LineString(line).buffer(1.5, cap_style="flat"),
        {"centerline": [list(map(list, line))], **properties},
    )


def star(*, told: bool) -> Network:
    """Four lanes towards the middle and four away from it, at uneven angles; each goes on to two of these."""
    degrees = {"w": 100, "n": 10, "e": -80, "s": -170}
    features: list[MapFeature] = []
    for name, angle in degrees.items():
        x, y = -math.sin(math.radians(angle)), math.cos(math.radians(angle))
        features.append(lane(f"{name}-in", [(60 * x + 2 * y, 60 * y - 2 * x), (20 * x + 2 * y, 20 * y - 2 * x)]))
        features.append(lane(f"{name}-out", [(20 * x - 2 * y, 20 * y + 2 * x), (60 * x - 2 * y, 60 * y + 2 * x)]))
    ways = [("n", "s"), ("w", "e"), ("w", "s"), ("e", "w"), ("s", "n"), ("n", "e"), ("e", "n"), ("s", "w")]
    ends = {feature.id: feature.properties["centerline"][0] for feature in features}
    after: dict[str, list[str]] = {}
    for start, end in ways:
        name = f"{start}{end}"
        line = [tuple(ends[f"{start}-in"][-1]), tuple(ends[f"{end}-out"][0])]
        features.append(lane(name, line, road=f"road-{name}", successors=[f"{end}-out"]))
        features.append(MapFeature(f"road-{name}", "road", features[-1].shape, {"intersection": "star"}))
        after.setdefault(f"{start}-in", []).append(name)
    features = [
        MapFeature(each.id, each.kind, each.shape, {**each.properties, "successors": after[each.id]})
        if each.id in after
        else each
        for each in features
    ]
    middle = LineString([(0, -20), (0, 20)]).buffer(20)
    # the order of maneuvers is that of the file, which the map tells or not
    order = {"incoming": ["n-in", "w-in", "e-in", "s-in"], "outgoing": TOLD_OUTGOING} if told else {}
    return Network("star", [*features, MapFeature("star", "intersection", middle, order)])


def _around(lanes: tuple[Lane, ...], end: int) -> list[str]:
    """By heading from the middle of the ends, said once more."""
    ends = {each.id: each.centerline.lines[0].coords[end] for each in lanes if each.centerline}
    x, y = (sum(at[axis] for at in ends.values()) / len(ends) for axis in (0, 1))
    return sorted(ends, key=lambda name: math.atan2(-(ends[name][0] - x), ends[name][1] - y))


@pytest.mark.parametrize("told", [True, False])
def test_lanes_of_an_intersection_go_round_it_and_its_maneuvers_start_by_start(told: bool) -> None:
    crossing = star(told=told).elements["star"]
    assert isinstance(crossing, Intersection)
    assert [each.id for each in crossing.incomingLanes] == _around(crossing.incomingLanes, -1)
    assert [each.id for each in crossing.incomingLanes] == ["s-in", "e-in", "n-in", "w-in"]
    onward = TOLD_OUTGOING if told else _around(crossing.outgoingLanes, 0)
    assert [each.id for each in crossing.outgoingLanes] == onward
    starts = ["n-in", "w-in", "e-in", "s-in"] if told else [each.id for each in crossing.incomingLanes]
    ways = [each.connectingLane.id for each in crossing.maneuvers if each.connectingLane]
    assert ways == [
        way for start in starts for way in {"n": "ns ne", "w": "we ws", "e": "ew en", "s": "sn sw"}[start[0]].split()
    ]
    conflicts = _read(star(told=told), crossing.maneuvers[0], "conflictingManeuvers")
    assert conflicts == tuple(each for each in crossing.maneuvers if each in conflicts), "in the same order"


def _read(network: Network, thing: Any, name: str) -> Any:
    value = attribute(Interpreter(3, False, lambda *_: None, network), thing, name, SPAN)
    return value.value if isinstance(value, Constant) else value


def street(**more: Any) -> Network:
    """A road of two sections: a second lane begins half way."""
    inner = lane("inner", [(0, 0), (0, 50)], group="group")
    outer = lane("outer", [(3, 20), (3, 50)], group="group")
    edges = {"left_edge": [[[-1.5, 0], [-1.5, 20]]], "right_edge": [[[1.5, 0], [1.5, 20]]]}
    later = {"left_edge": [[[-1.5, 20], [-1.5, 50]]], "right_edge": [[[1.5, 20], [1.5, 50]]]}
    beside = {"left_edge": [[[1.5, 20], [1.5, 50]]], "right_edge": [[[4.5, 20], [4.5, 50]]]}
    area = inner.shape
    return Network(
        "street",
        [
            inner,
            outer,
            MapFeature("group", "lane_group", area, {"road": "road", "sidewalk": "far walk", "shoulder": []}),
            MapFeature(
                "road", "road", area,
                {"forward": "group", "name": "High Street", "source_id": 7, "successor": [], "signals": [
                    {"id": "lights", "number": "12", "country": "OpenDRIVE", "type": "1000001"},
                ]},
            ),
            MapFeature("inner 0", "lane_section", area, {"lane": "inner", "number": -1, **edges}),
            MapFeature("inner 1", "lane_section", area, {"lane": "inner", "right": "outer 1", "number": -1, **later}),
            MapFeature("outer 1", "lane_section", area, {"lane": "outer", "left": "inner 1", "number": -2, **beside}),
            MapFeature("first", "road_section", area, {"road": "road", "forward": ["inner 0"], "successor": "last"}),
            MapFeature("last", "road_section", area, {"road": "road", "forward": ["outer 1", "inner 1"]}),
            MapFeature("near walk", "sidewalk", outer.shape, {}),
            MapFeature("far walk", "sidewalk", inner.shape, {"road": "road", **edges}),
            *more.get("more", ()),
        ],
    )  # fmt: skip


def test_what_the_map_says_of_an_element_counts() -> None:
    network = street()
    assert network.problems == ()
    road, group = network.elements["road"], network.elements["group"]
    assert _read(network, group, "sidewalk").id == "far walk", "not the one that lies nearest"
    assert _read(network, group, "_shoulder") is None
    assert _read(network, road, "sidewalks") == (network.elements["far walk"],)
    assert _read(network, road, "name") == "High Street"
    assert _read(network, road, "id") == 7
    assert [each.id for each in _read(network, road, "sections")] == ["first", "last"]
    assert [each.id for each in _read(network, network, "roadSections")] == ["first", "last"]
    (signal,) = _read(network, road, "signals")
    assert _read(network, signal, "isTrafficLight") is True
    assert _read(network, signal, "openDriveID") == "12"
    last = network.elements["last"]
    assert [each.id for each in _read(network, last, "lanes")] == ["outer 1", "inner 1"]
    assert {number: each.id for number, each in _read(network, last, "lanesByOpenDriveID").items()} == {
        -2: "outer 1", -1: "inner 1",
    }  # fmt: skip
    assert _read(network, network.elements["first"], "successor") is last
    assert _read(network, network.elements["inner 0"], "_successor").id == "inner 1"
    with pytest.raises(ScenarioError):
        _read(network, road, "successor")


def test_edges_of_lanes_groups_and_roads_are_made_of_those_of_their_sections() -> None:
    network = street()
    expected = {
        ("inner", "leftEdge"): [(-1.5, 0), (-1.5, 50)],
        ("inner", "rightEdge"): [(1.5, 0), (1.5, 50)],
        ("group", "leftEdge"): [(-1.5, 0), (-1.5, 50)],
        ("group", "rightEdge"): [(1.5, 0), (1.5, 20), (4.5, 20), (4.5, 50)],
        ("road", "rightEdge"): [(1.5, 0), (1.5, 20), (4.5, 20), (4.5, 50)],
        ("road", "leftEdge"): [(-1.5, 0), (-1.5, 50)],
        ("last", "rightEdge"): [(4.5, 20), (4.5, 50)],
        ("far walk", "leftEdge"): [(-1.5, 0), (-1.5, 20)],
    }
    for (name, edge), corners in expected.items():
        (line,) = _read(network, network.elements[name], edge).lines
        assert list(line.coords) == corners, (name, edge)


def test_a_reference_to_what_is_not_there_is_told() -> None:
    stray = MapFeature("stray", "road_section", street().elements["inner"].polygon, {"road": "road", "successor": "x"})
    assert [message for _, message in dangling([*street(more=[stray]).features])] == [
        "`successor` of road_section `stray`: `x` is not in the map"
    ]


@pytest.mark.parametrize("told", [True, False])
def test_where_ways_overlap_the_direction_of_the_first_comes_first(told: bool) -> None:
    network = star(told=told)
    (crossing,) = network.intersections
    met = 0
    for number in range(400):
        x, y = number % 20 - 9.7, number // 20 - 9.7
        ways = [each.connectingLane for each in crossing.maneuvers if each.connectingLane is not None]
        ways = [way for way in ways if way.polygon.covers(Point(x, y))]
        met += len(ways) > 1
        if ways:
            (start, end) = ways[0].centerline.lines[0].coords
            heading = math.atan2(start[0] - end[0], end[1] - start[1])
            assert network.roadDirection.values(x, y)[0] == pytest.approx(heading)
    assert met > 30
