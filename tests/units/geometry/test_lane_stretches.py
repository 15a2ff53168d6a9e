"""Stretches of lanes: areas that are known without cutting."""

from __future__ import annotations

import pytest
import shapely
from shapely import LineString, Polygon, box

from scenicq.geometry.features import MapFeature
from scenicq.geometry.lane_stretches import ahead_in_lanes, stretch
from scenicq.geometry.network import Network

LANES = [
    MapFeature("a", "lane", box(-2, 0, 2, 20), {"centerline": [[[0, 0], [0, 20]]], "successors": ["left", "on"]}),
    MapFeature("on", "lane", box(-2, 20, 2, 30), {"centerline": [[[0, 20], [0, 30]]], "successors": ["a"]}),
    MapFeature(
        "left", "lane", box(-30, 20, 0, 24).union(box(-2, 20, 2, 24)),
        {"centerline": [[[0, 20], [0, 22], [-30, 22]]]},
    ),
    MapFeature("plain", "lane", box(100, 0, 104, 20), {}),
    MapFeature("across", "lane", box(-20, 8, 20, 12), {"centerline": [[[-20, 10], [20, 10]]]}),
]  # fmt: skip
TOWN = Network("town", LANES)


def ahead(x, y, metres, heading=0.0, last=None):
    return shapely.union_all(ahead_in_lanes(TOWN, x, y, heading, last, metres))


def same(one, other):
    return one.symmetric_difference(other).area < 1e-9


@pytest.mark.parametrize(
    ("metres", "expected"),
    [
        (10, box(-2, 5, 2, 15)),
        (15, box(-2, 5, 2, 20)),
        # both ways on
        (21, box(-2, 5, 2, 26).union(box(-4, 20, 0, 24))),
        # where lanes lead around, the shortest way to each counts
        (25, box(-2, 5, 2, 30).union(box(-8, 20, 0, 24))),
        (30, box(-2, 5, 2, 30).union(box(-13, 20, 0, 24))),
    ],
)
def test_ahead_are_so_many_metres_of_each_way_on(metres, expected):
    assert same(ahead(1, 5, metres), expected)


def test_of_several_lanes_those_that_lead_its_way_count():
    assert same(ahead(0, 10, 5), box(-2, 10, 2, 15))
    assert same(ahead(0, 10, 5, heading=-1.5), box(0, 8, 5, 12))
    assert same(ahead(0, 10, 5, heading=None), box(-2, 10, 2, 15).union(box(0, 8, 5, 12)))
    # the last lane is the first, which goes on from itself
    assert same(ahead(0, 10, 5, heading=-1.5, last=0.0), box(-2, 10, 2, 15).union(box(0, 8, 5, 12)))


def test_nothing_is_ahead_where_no_lane_with_a_middle_is():
    assert not ahead_in_lanes(TOWN, 102, 5, 0.0, None, 10)
    assert not ahead_in_lanes(TOWN, 50, 50, 0.0, None, 10)


def test_a_cut_ends_where_the_area_does():
    # both arms of a lane that turns around: the cut across one leaves the other whole
    area = Polygon([(0, 0), (4, 0), (4, 20), (6, 20), (6, 0), (10, 0), (10, 24), (0, 24)])
    line = LineString([(2, 0), (2, 22), (8, 22), (8, 0)])
    found = shapely.union_all(stretch(area, line, 10, line.length))
    assert same(found, area.difference(box(0, 0, 4, 10)))
    assert same(shapely.union_all(stretch(area, line, 0, 10)), box(0, 0, 4, 10))
    assert stretch(area, line, 10, 10) == []
