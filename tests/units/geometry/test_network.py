"""The network's elements and references, on a small town drawn by hand."""

# pyright: basic

import math
import pickle
from typing import Any

import pytest
from shapely.geometry import LineString, box

from scenicq.geometry.elements import Lane, LaneGroup, MissingElementError, Road
from scenicq.geometry.features import MapFeature
from scenicq.geometry.membership import contains
from scenicq.geometry.network import Network
from scenicq.geometry.regions import PolylineSet


def area(identifier: str, kind: str, bounds: tuple[float, float, float, float], **properties: Any) -> MapFeature:
    return MapFeature(identifier, kind, box(*bounds), properties)


def town(*more: MapFeature) -> Network:
    """A road along x = 0 with two lanes north (0 to 8) and one south (-4 to 0), an intersection above, a road beyond.

    The inner lane north is cut into two sections.
    """
    return Network(
        "town",
        [
            area("road", "road", (-4, 0, 8, 40), forward="north", backward="south"),
            area("north", "lane_group", (0, 0, 8, 40), road="road", opposite="south"),
            area("south", "lane_group", (-4, 0, 0, 40), road="road", opposite="north"),
            area(
                "inner",
                "lane",
                (0, 0, 4, 40),
                group="north",
                centerline=[[[2, 0], [2, 40]]],
                right="outer",
                left="back",
            ),
            area("inner1", "lane_section", (0, 0, 4, 20), lane="inner", right="outer"),
            area("inner2", "lane_section", (0, 20, 4, 40), lane="inner", right="outer", left="back"),
            area(
                "outer",
                "lane",
                (4, 0, 8, 40),
                group="north",
                left="inner",
                centerline=[[[6, 0], [6, 40]]],
                successors=["turn"],
            ),
            area("back", "lane", (-4, 0, 0, 40), group="south", road="road", centerline=[[[-2, 40], [-2, 0]]]),
            area("cross", "intersection", (-4, 40, 8, 50), roads=["road", "far"]),
            area("inside", "road", (4, 40, 8, 50), intersection="cross", forward=["turns", "more"]),
            area("turns", "lane_group", (4, 40, 6, 50)),
            area("more", "lane_group", (6, 40, 8, 50)),
            area("turn", "lane", (4, 40, 6, 50), group="turns", centerline=[[[5, 40], [5, 50]]], successors=["exit"]),
            area("exit", "lane", (4, 50, 8, 60), road="far", centerline=[[[6, 50], [6, 60]]]),
            area("far", "road", (4, 50, 8, 60)),
            area("zebra", "crossing", (-4, 36, 8, 39)),
            area("walk", "sidewalk", (8, 0, 10, 40)),
            area("edge", "shoulder", (-6, 0, -4, 40)),
            MapFeature("kerb", "curb", LineString([(8, 0), (8, 40)])),
            area("garage", "parking", (20, 0, 30, 10)),
            area("plaza", "drivable", (40, 0, 50, 10)),
            *more,
        ],
    )


def test_curbs_of_lane_groups() -> None:
    own = MapFeature("edge of turn", "curb", LineString([(6, 50), (6, 40)]), {"group": "turns"})
    other = MapFeature("edge of road", "curb", LineString([(7.9, 0), (7.9, 40)]), {"group": "north"})
    network = town(own, other)
    group, inside = network.elements["north"], network.elements["turns"]
    assert isinstance(group, LaneGroup)
    assert isinstance(inside, LaneGroup)
    assert [list(line.coords) for line in network.curbs_of(group)] == [[(7.9, 0.0), (7.9, 40.0)]]
    assert [list(line.coords) for line in network.curbs_of(inside)] == [[(6.0, 40.0), (6.0, 50.0)]], "with the traffic"
    # what lies inside an intersection is no part of all curbs
    assert contains(network.curbRegion, 7.9, 20)
    assert contains(network.curbRegion, 8, 20)
    assert not contains(network.curbRegion, 6, 45)
    dangling = MapFeature("stray", "curb", LineString([(0, 0), (0, 1)]), {"group": "nowhere"})
    assert town(dangling).problems == ("`group` of curb `stray`: `nowhere` is not in the map",)


def test_a_curb_runs_as_the_lanes_of_its_group_do_although_others_lie_there_too() -> None:
    # the middle of the curb lies on a lane across, which runs the other way
    own = MapFeature("edge of road", "curb", LineString([(7.9, 0), (7.9, 40)]), {"group": "north"})
    across = area("across", "lane", (7, 15, 9, 25), centerline=[[[8, 25], [8, 15]]])
    crossed = Network("town", [across, *town(own).features])
    group = crossed.elements["north"]
    assert isinstance(group, LaneGroup)
    assert [list(line.coords) for line in crossed.curbs_of(group)] == [[(7.9, 0.0), (7.9, 40.0)]]


def lane(network: Network, name: str) -> Lane:
    found = network.elements[name]
    assert isinstance(found, Lane)
    return found


def test_elements_by_kind() -> None:
    network = town()
    assert network.problems == ()
    assert [e.id for e in network.lanes] == ["inner", "outer", "back", "turn", "exit"]
    assert [e.id for e in network.roads] == ["road", "far"]
    assert [e.id for e in network.connectingRoads] == ["inside"]
    assert {e.id for e in network.laneSections} == {"inner1", "inner2", "outer_sec", "back_sec", "turn_sec", "exit_sec"}
    assert [e.uid for e in (*network.crossings, *network.sidewalks, *network.shoulders)] == ["zebra", "walk", "edge"]
    assert [curb.id for curb in network.curbs] == ["kerb"]


def test_roads_groups_and_lanes_refer_to_each_other() -> None:
    network = town()
    road = network.elements["road"]
    assert isinstance(road, Road)
    assert [one.id for one in road.lanes] == ["inner", "outer", "back"]
    assert [group.id for group in road.laneGroups] == ["north", "south"]
    assert not road.is1Way
    north, south = road.forwardLanes, road.backwardLanes
    assert north is not None
    assert south is not None
    assert north.opposite is south
    assert south.opposite is north
    assert north.road is road
    assert lane(network, "inner").road is road
    assert lane(network, "inner").group is north
    assert lane(network, "exit").road is network.elements["far"]
    assert lane(network, "outer").isForward
    assert not lane(network, "back").isForward


def test_several_groups_of_one_direction_become_one() -> None:
    inside = town().elements["inside"]
    assert isinstance(inside, Road)
    assert isinstance(inside.forwardLanes, LaneGroup)
    assert inside.forwardLanes.polygon.area == pytest.approx(40)
    assert [one.id for one in inside.lanes] == ["turn"]
    assert inside.is1Way


def test_sections_and_their_neighbours() -> None:
    network = town()
    first, second = lane(network, "inner").sections
    (outer,) = lane(network, "outer").sections
    (back,) = lane(network, "back").sections
    assert outer.polygon is lane(network, "outer").polygon
    assert first.laneToRight is second.laneToRight is outer
    assert first._laneToLeft is None
    with pytest.raises(MissingElementError, match="lane to its left"):
        _ = first.laneToLeft
    assert second.laneToLeft is back
    assert second._fasterLane is None, "the lane to the left runs the other way"
    assert second.slowerLane is outer
    assert outer.laneToLeft is first
    assert outer.fasterLane is first
    assert [one.id for one in lane(network, "inner").adjacentLanes] == ["outer", "back", "outer"]
    assert [section.isForward for section in (first, second, outer, back)] == [True, True, True, False]


def test_the_way_through_an_intersection() -> None:
    network = town()
    (crossing,) = network.intersections
    assert [road.id for road in crossing.roads] == ["road", "far"]
    assert not crossing.is3Way
    assert not crossing.is4Way
    outer, turn, onward = (lane(network, name) for name in ("outer", "turn", "exit"))
    assert crossing.incomingLanes == (outer,)
    assert crossing.outgoingLanes == (onward,)
    assert outer.successor is turn
    assert onward.predecessor is turn
    (maneuver,) = outer.maneuvers
    assert (maneuver.startLane, maneuver.connectingLane, maneuver.endLane) == (outer, turn, onward)
    assert maneuver.intersection is crossing
    assert crossing.maneuvers == (maneuver,)
    with pytest.raises(MissingElementError, match="successor"):
        _ = onward.successor


def test_regions() -> None:
    network = town()
    assert contains(network.drivableRegion, 45, 5)
    assert contains(network.drivableRegion, 1, 45)
    assert not contains(network.drivableRegion, 9, 5)
    assert contains(network.walkableRegion, 9, 5)
    assert contains(network.walkableRegion, 0, 37)
    assert isinstance(network.curbRegion, PolylineSet)
    assert "_made" not in vars(network.curbRegion)  # until somebody asks where the curbs are
    assert contains(network.curbRegion, 8, 3)
    assert "_made" in vars(network.curbRegion)
    assert network.curbRegion.orientation is not None
    parking = network.region("parking")
    assert parking is not None
    assert contains(parking, 25, 5)
    assert network.region("lane") is network.laneRegion
    assert network.region("curb") is network.curbRegion
    assert network.region("moat") is None
    assert Network("bare", []).region("sidewalk") is None
    assert not Network("bare", []).sidewalkRegion.pieces
    assert network.laneRegion.orientation is network.roadRegion.orientation is network.roadDirection
    assert network.sidewalkRegion.orientation is None
    inner = lane(network, "inner")
    assert inner.region.orientation is inner.orientation is not network.roadDirection
    assert contains(network.roadRegion, 1, 5)
    assert not contains(network.roadRegion, 7, 45), "the road inside the intersection is none of the roads"


def test_lookups() -> None:
    network = town()

    def name(found: Any) -> str | None:
        return found.id if found else None

    assert name(network.laneAt(1, 5)) == "inner"
    assert name(network.laneAt(4, 5)) == "inner", "the border lies in both: the first in the map's order"
    assert name(network.laneSectionAt(1, 25)) == "inner2"
    assert name(network.laneGroupAt(-1, 5)) == "south"
    assert name(network.laneGroupAt(7, 45)) == "more"
    assert name(network.roadAt(1, 5)) == "road"
    assert name(network.roadAt(7, 45)) == "inside"
    assert name(network.intersectionAt(0, 45)) == "cross"
    assert name(network.crossingAt(0, 37)) == "zebra"
    assert name(network.sidewalkAt(9, 5)) == "walk"
    assert name(network.elementAt(5, 45)) == "cross"
    assert name(network.elementAt(5, 5)) == "road"
    assert name(network.elementAt(-5, 5)) == "edge"
    lookups = (network.laneAt, network.laneSectionAt, network.roadAt, network.intersectionAt, network.elementAt)
    assert [lookup(99, 99) for lookup in lookups] == [None] * 5
    assert network.roadDirection.values(9, 5) == (0.0,)
    assert network.roadDirection.values(45, 5) == ()


def test_where_elements_overlap_the_first_in_the_order_of_the_map_counts() -> None:
    def middle(x: float) -> list[list[list[float]]]:
        return [[[x, 40], [x, 50]]]

    # nearer centrelines, but later in the map
    across = area("across", "road", (-4, 40, 8, 46), forward="along", intersection="cross")
    along = area("along", "lane_group", (-4, 40, 8, 46), road="across")
    later = area("later", "lane", (4, 40, 8, 46), group="along", centerline=middle(5.8))
    network = town(across, along, later)
    found = (network.laneAt, network.laneSectionAt, network.laneGroupAt, network.roadAt)
    assert [getattr(each(5.8, 45), "id", None) for each in found] == ["turn", "turn_sec", "turns", "inside"]
    assert [getattr(each(7, 47), "id", None) for each in found] == [None, None, "more", "inside"]
    assert [getattr(each(0, 45), "id", None) for each in found] == [None, None, "along", "across"]


def test_within_the_tolerance_of_elements_counts_where_none_holds_the_point() -> None:
    network = town()
    assert network.laneAt(-4.04, 5) is network.elements["back"]
    assert network.roadAt(-4.04, 5) is network.elements["road"]
    assert network.elementAt(-4.04, 5) is network.elements["edge"], "which holds it"
    assert network.laneAt(-4.06, 5) is None


def test_problems_are_listed_and_passed_over() -> None:
    network = town(
        area("inner", "lane", (0, 0, 1, 1)),
        area("lost", "lane", (60, 0, 64, 9), left="nowhere", road="cross", successors=["nirvana"]),
        area("part", "lane_section", (60, 0, 64, 9), lane="nobody"),
    )
    assert len(network.problems) == 5
    assert network.problems[0] == "lane `inner`: the id is used before"
    lost = lane(network, "lost")
    assert lost.road is None
    assert lost.successors == ()
    assert lost.sections[0]._laneToLeft is None
    assert "part" not in network.elements


def test_pickling_rebuilds() -> None:
    network = pickle.loads(pickle.dumps(town()))
    assert network.name == "town"
    assert list(network.elements) == list(town().elements)
    assert contains(network.laneRegion, 1, 5)


def test_sidewalks_and_shoulders_run_along_their_centrelines_where_the_map_gives_them() -> None:
    slanted = [[[8.5, 0], [9.5, 40]]]
    walk = area("walk", "sidewalk", (8, 0, 10, 40), centerline=slanted)
    edge = area("edge", "shoulder", (-6, 0, -4, 40), centerline=[[[-5, 40], [-5, 0]]])
    plain = [each for each in town().features if each.id not in ("walk", "edge")]
    network = Network("town", [*plain, walk, edge])
    along = -math.atan2(1, 40)
    for field in (network.sidewalkRegion.orientation, network.sidewalks[0].orientation):
        assert field is not None
        assert field.values(9, 20) == pytest.approx((along,))
    for field in (network.shoulderRegion.orientation, network.shoulders[0].orientation):
        assert field is not None
        assert field.values(-5, 20) == pytest.approx((math.pi,))
    assert network.sidewalks[0].centerline is not None
    assert network.sidewalks[0].centerline.lines[0].length == pytest.approx(math.hypot(1, 40))
    # crossings have no direction here, so what holds them as well has none
    assert network.walkableRegion.orientation is None
    # overlapping ones have a say each
    other = area("other", "sidewalk", (8, 0, 10, 40), centerline=[[[9, 40], [9, 0]]])
    both = Network("town", [*plain, walk, other]).sidewalkRegion.orientation
    assert both is not None
    assert both.values(9, 20) == pytest.approx((along, math.pi))
    # one without a centreline leaves them all without
    silent = area("other", "sidewalk", (20, 0, 22, 40))
    network = Network("town", [*plain, walk, silent, area("edge", "shoulder", (-6, 0, -4, 40))])
    assert network.sidewalkRegion.orientation is None
    assert network.sidewalks[1].centerline is None
    assert network.shoulderRegion.orientation is network.roadDirection
