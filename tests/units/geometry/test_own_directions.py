"""The preferred heading of each element, and the direction of traffic on shoulders, on a small town made by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from shapely.geometry import box

from scenicq.geometry.features import MapFeature
from scenicq.geometry.network import Network
from scenicq.geometry.road_direction import RoadDirection

NORTH, EAST, SOUTH, WEST = 0.0, -math.pi / 2, math.pi, math.pi / 2
Line = list[list[list[float]]]


def area(name: str, kind: str, bounds: tuple[float, float, float, float], **properties: Any) -> MapFeature:
    return MapFeature(name, kind, box(*bounds), properties)


def town() -> Network:
    """A road north with a lane each way, a bent lane east of it, and an intersection that two lanes cross."""
    up: Line = [[[2, 0], [2, 40]]]
    down: Line = [[[-2, 40], [-2, 0]]]
    bent: Line = [[[30, 0], [30, 20], [60, 20]]]
    return Network(
        "town",
        [
            area("up", "lane", (0, 0, 4, 40), centerline=up, group="ups", successors=["through"]),
            area("down", "lane", (-4, 0, 0, 40), centerline=down, group="downs"),
            area("bent", "lane", (28, 0, 60, 22), centerline=bent),
            area("ups", "lane_group", (0, 0, 4, 40), road="main"),
            area("downs", "lane_group", (-4, 0, 0, 40), road="main"),
            area("main", "road", (-4, 0, 4, 40), forward="ups", backward="downs", centerline=[[[0, 0], [0, 40]]]),
            area("through", "lane", (0, 40, 4, 60), centerline=[[[2, 40], [2, 60]]], road="a", successors=["on"]),
            area("across", "lane", (-10, 48, 10, 52), centerline=[[[-10, 50], [10, 50]]], road="b"),
            area("a", "road", (0, 40, 4, 60), intersection="cross"),
            area("b", "road", (-10, 48, 10, 52), intersection="cross"),
            area("on", "lane", (0, 60, 4, 80), centerline=[[[2, 60], [2, 80]]]),
            area("cross", "intersection", (-10, 40, 10, 60), roads=["main"]),
            area("side", "shoulder", (4, 0, 6, 50), centerline=[[[5, 50], [5, 0]]], road="main"),
        ],
    )


@pytest.mark.parametrize(
    ("name", "x", "y", "expected"),
    [
        ("up", 2, 20, NORTH),
        ("up", -2, 20, NORTH),  # in the other lane, it is still the lane's own
        ("up", 500, -700, NORTH),  # and however far away
        ("bent", 30, 5, NORTH),
        ("bent", 50, 19, EAST),
        ("bent", 50, 400, EAST),
        ("ups", -2, 20, NORTH),
        ("downs", 2, 20, SOUTH),
        ("main", 2, 20, NORTH),
        ("main", -2, 20, SOUTH),
        ("main", 90, 20, NORTH),  # off its lanes along its own centreline
        ("cross", 8, 41, NORTH),  # the nearest way through it
        ("side", 2, 20, SOUTH),
    ],
)
def test_each_element_has_a_direction_of_its_own(name: str, x: float, y: float, expected: float) -> None:
    field = town().elements[name].orientation
    assert field is not None
    assert field.values(x, y) == pytest.approx((expected,))
    assert field.first(x, y) == pytest.approx(expected)


def test_traffic_on_a_shoulder_goes_as_the_shoulder_does_and_nowhere_else() -> None:
    direction = town().roadDirection
    assert direction.values(5, 20) == pytest.approx((SOUTH,))
    assert direction.values(3.9, 20) == pytest.approx((NORTH,)), "lanes come first"
    assert direction.values(5, 45) == pytest.approx((NORTH,)), "in the intersection it is the nearest lane's"
    assert direction.values(9, 20) == pytest.approx((NORTH,)), "beside everything, too"


@pytest.mark.parametrize("name", ["up", "bent", "ups", "main", "cross", "side", "roadDirection"])
def test_cells_and_boxes_hold_every_heading_of_a_field(name: str) -> None:
    network = town()
    field = network.roadDirection if name == "roadDirection" else network.elements[name].orientation
    assert isinstance(field, RoadDirection)
    rng = np.random.default_rng(3)
    for _ in range(40):
        west, south = rng.uniform(-15, 60), rng.uniform(-5, 70)
        bounds = (west, south, west + rng.uniform(0.1, 9), south + rng.uniform(0.1, 9))
        cells = field.cells(bounds)
        owner, headings = field.headings(np.array([bounds]))
        assert set(owner.tolist()) <= {0}
        for x, y in rng.uniform(bounds[:2], bounds[2:], (6, 2)).tolist():
            for heading in field.values(x, y):
                assert min(abs(headings - heading), default=9.0) < 1e-6, (name, x, y)
                assert any(_holds(cell, x, y, heading) for cell in cells), (name, x, y, heading)


def _holds(cell: Any, x: float, y: float, heading: float) -> bool:
    """Whether a cell with a heading covers a point, as far as it surely says."""
    if abs(cell.heading - heading) > 1e-6 or cell.part((x - 1e-6, y - 1e-6, x + 1e-6, y + 1e-6)) is None:
        return False
    corners = cell.polygon
    along = np.roll(corners, -1, axis=0) - corners
    to = np.array((x, y)) - corners
    return bool((along[:, 0] * to[:, 1] - along[:, 1] * to[:, 0] >= -1e-6).all())
