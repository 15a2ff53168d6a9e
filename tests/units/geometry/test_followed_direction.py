"""The direction of traffic on the way along it: off the road there is heading 0 besides that of the nearest lane."""

# pyright: basic

import math

import numpy as np
from shapely.geometry import Point, Polygon, box

from scenicq.geometry.followed_direction import FollowedDirection
from scenicq.geometry.road_direction import DirectedLane, RoadDirection

SOUTH, EAST = math.pi, -math.pi / 2
UP = DirectedLane(box(-2, -40, 2, 40), (np.array([(0.0, 40.0), (0.0, -40.0)]),))
ACROSS = DirectedLane(box(2, -2, 40, 2), (np.array([(2.0, 0.0), (40.0, 0.0)]),))
YARD = box(-10, -5, -2, 5)


def field() -> FollowedDirection:
    base = RoadDirection((UP, ACROSS))
    return FollowedDirection(base.lanes, base=base, paved=(UP.area, ACROSS.area, YARD))


def test_off_the_road_there_are_two_directions() -> None:
    direction = field()
    assert direction.values(0, 10) == (SOUTH,)
    assert direction.values(20, 1) == (EAST,)
    assert direction.values(4, 10) == (0.0, SOUTH)
    assert direction.values(-6, 0) == (SOUTH,), "what is paved is no lane, but belongs to the road"
    assert direction.values(2.04, 10) == (SOUTH,), "the edge of the road is 5 cm wide"
    assert direction.values(500, 500) == (0.0,), "no lane is near"


def test_boxes_and_cells_hold_every_direction() -> None:
    direction, rng = field(), np.random.default_rng(3)
    for size in (0.0, 0.5, 6.0, 80.0, 900.0):
        corners = rng.uniform(-60, 60, (20, 2))
        boxes = np.concatenate([corners, corners + size], axis=1)
        owner, heading = direction.headings(boxes)
        assert list(owner) == sorted(owner), "box by box"
        for number, (low, high) in enumerate(zip(boxes[:, :2], boxes[:, 2:], strict=True)):
            points = rng.uniform(low, high, (30, 2))
            allowed = heading[owner == number]
            for values in direction.values_many(points):
                assert all(np.abs(allowed - value).min() < 1e-8 for value in values)
    area = (-50.0, -50.0, 50.0, 50.0)
    cells = [(cell, Polygon(cell.polygon)) for cell in direction.cells(area)]
    some = direction.cells_of(0.0, area)
    for (x, y), values in zip(xy := rng.uniform(-50, 50, (200, 2)), direction.values_many(xy), strict=True):
        here = Point(x, y)
        holding = [cell for cell, shape in cells if shape.distance(here) < 1e-9]
        assert all(any(abs(cell.heading - value) < 1e-9 for cell in holding) for value in values)
        off = [cell for cell in some if cell.heading == 0.0 and Polygon(cell.polygon).contains(here)]
        assert bool(off) == (0.0 in values)
