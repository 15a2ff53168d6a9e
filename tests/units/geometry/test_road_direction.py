"""The direction of traffic against its definition in plain loops, and cells against sampled points."""

# pyright: basic

import math
import random

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Point, Polygon, box

from scenicq.geometry.angles import distance, rotate_array
from scenicq.geometry.cell_guards import NearestSegment, Within, half_planes, narrow_guards
from scenicq.geometry.fields import VectorField
from scenicq.geometry.followed_direction import OFF_ROAD, FollowedDirection
from scenicq.geometry.road_direction import DirectedLane, RoadDirection, along_lines

NORTH, WEST, SOUTH, EAST = 0.0, math.pi / 2, math.pi, -math.pi / 2


def lane(area: Polygon, *lines: list[tuple[float, float]]) -> DirectedLane:
    return DirectedLane(area, tuple(np.array(line, dtype=float) for line in lines))


def expected(field: RoadDirection, x: float, y: float) -> list[float]:
    """The definition, in loops."""
    here = Point(x, y)
    directed = []
    for one in field.lanes:
        found = []
        for line in one.centerline:
            for (x0, y0), (x1, y1) in zip(line[:-1].tolist(), line[1:].tolist(), strict=True):
                if (x0, y0) != (x1, y1):
                    found.append((LineString([(x0, y0), (x1, y1)]).distance(here), math.atan2(x0 - x1, y1 - y0)))
        if found:
            directed.append((one.area, found))
    holding = [found for area, found in directed if area.distance(here) <= 1e-9]
    if not holding:
        nearest = min((area.distance(here) for area, _ in directed), default=math.inf)
        if nearest <= 20:
            holding = [found for area, found in directed if area.distance(here) <= nearest + 1e-9]
    return [heading for found in holding for away, heading in found if away <= min(found)[0] + 1e-9]


def same(found: tuple[float, ...], wanted: list[float]) -> bool:
    def near(a: float, others: list[float] | tuple[float, ...]) -> bool:
        return any(distance(a, b) < 1e-9 for b in others)

    return all(near(a, wanted) for a in found) and all(near(b, found) for b in wanted)


@st.composite
def fields(draw: st.DrawFn) -> RoadDirection:
    """A few bent lanes, some of which overlap."""
    number = st.integers(-12, 12).map(float)
    lanes = []
    for _ in range(draw(st.integers(1, 4))):
        line = draw(st.lists(st.tuples(number, number), min_size=2, max_size=5))
        area = LineString(line).buffer(
            draw(st.sampled_from([1.0, 2.5])), cap_style="flat", join_style="mitre", mitre_limit=2
        )
        if area.geom_type == "Polygon" and area.is_valid and area.area > 0.1:
            lanes.append(lane(area, line))
    return RoadDirection(tuple(lanes))


@settings(max_examples=120, deadline=None)
@given(fields(), st.lists(st.tuples(st.floats(-40, 40), st.floats(-40, 40)), min_size=1, max_size=20))
def test_values_agree_with_the_definition(field: RoadDirection, places: list[tuple[float, float]]) -> None:
    for (x, y), found in zip(places, field.values_many(np.array(places)), strict=True):
        wanted = expected(field, x, y)
        assert same(found, wanted), (x, y)
        assert not found or same(found[:1], wanted[:1]), f"at {x}, {y} the first lane comes first"
        assert found == field.values(x, y)
        assert all(-math.pi < heading <= math.pi for heading in found)


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(fields(), st.integers(0, 2**32))
def test_cells_cover_the_field(field: RoadDirection, seed: int) -> None:
    cells = field.cells((-16.0, -16.0, 16.0, 16.0))
    shapes = [Polygon(cell.polygon) for cell in cells]
    xy = np.random.default_rng(seed).uniform(-16, 16, (150, 2))
    for point, values in zip(xy, field.values_many(xy), strict=True):
        here = Point(point)
        near = [cell for cell, shape in zip(cells, shapes, strict=True) if shape.distance(here) < 1e-6]
        for value in values:
            assert any(distance(cell.heading, value) < 1e-9 for cell in near), (point, value)
        for cell, shape in zip(cells, shapes, strict=True):
            if not cell.guards and shape.contains(here) and shape.exterior.distance(here) > 1e-6:
                assert any(distance(cell.heading, value) < 1e-9 for value in values), (point, cell)


@settings(max_examples=10, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(fields(), st.integers(0, 2**32))
@pytest.mark.slow
def test_guards_say_which_points_of_a_cell_are_meant(field: RoadDirection, seed: int) -> None:
    cells = field.cells((-16.0, -16.0, 16.0, 16.0))
    shapes = [Polygon(cell.polygon) for cell in cells]
    beside = [(dx, dy) for dx in (-1e-5, 0.0, 1e-5) for dy in (-1e-5, 0.0, 1e-5)]
    for x, y in np.random.default_rng(seed).uniform(-16, 16, (40, 2)).tolist():
        values, *others = field.values_many(np.array([(x + dx, y + dy) for dx, dy in beside]))
        holding = [cell for cell, shape in zip(cells, shapes, strict=True) if shape.contains(Point(x, y))]
        if any(each != values for each in others):
            # on a border, rounding decides
            continue
        for half in (0.0, 0.01, 1.0):
            box = (x - half, y - half, x + half, y + half)
            meant = [part.heading for cell in holding if (part := cell.part(box)) is not None]
            assert all(any(distance(heading, value) < 1e-9 for heading in meant) for value in values), (x, y, half)
            sure = [part.heading for cell in holding if (part := cell.part(box)) is not None and not part.guards]
            for heading in meant if half == 0.0 else sure:
                assert any(distance(heading, value) < 1e-9 for value in values), (x, y, half, heading)


@settings(max_examples=20, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(fields(), st.integers(0, 2**32))
@pytest.mark.slow
def test_half_planes_hold_what_guards_mean(field: RoadDirection, seed: int) -> None:
    rng = np.random.default_rng(seed)
    guarded = [cell for cell in field.cells((-16.0, -16.0, 16.0, 16.0)) if cell.guards]
    for cell in [guarded[number] for number in rng.integers(0, len(guarded), 10)] if guarded else []:
        x, y = rng.uniform(cell.polygon.min(axis=0), cell.polygon.max(axis=0)).tolist()
        half = 10 ** rng.uniform(-3, 0)
        bounds = (x - half, y - half, x + half, y + half)
        if (part := cell.part(bounds)) is None:
            continue
        for a, b, c in half_planes(part.guards, bounds):
            for px, py in rng.uniform(bounds[:2], bounds[2:], (30, 2)).tolist():
                assert a * px + b * py <= c or narrow_guards(part.guards, (px, py, px, py)) is None


def test_half_planes_are_as_close_as_a_border_is_straight() -> None:
    # the border between a line and a point 5 m beside it is x = 2.5 + y ** 2 / 10
    guard = NearestSegment(np.array([(0.0, -9.0, 0.0, 9.0)]), np.array([(5.0, 0.0, 5.0, 0.0)]))
    for half in (0.1, 0.01):
        ((a, b, c),) = half_planes([guard], (2.5 - half, -half, 2.5 + half, half))
        assert (a, b) == pytest.approx((2.0, 0.0))
        assert half**2 / 10 <= c / a - 2.5 <= half**2 / 4
    assert half_planes([guard, Within(guard.rivals, 3.0)], (1.9, -0.1, 2.1, 0.1))[1] == pytest.approx((-1.0, 0.0, -2.0))


def test_a_bend_ties_on_its_outer_side_only() -> None:
    bend = lane(box(-5, -5, 15, 15), [(0, -5), (0, 10), (-5, 10)])
    field = RoadDirection((bend,))
    assert field.values(-1, 5) == (NORTH,)
    assert field.values(-4, 9) == (WEST,)
    assert set(field.values(2, 12)) == {NORTH, WEST}, "the corner is the nearest point of both segments"
    assert set(field.values(-3, 7)) == {NORTH, WEST}, "on the bisector"


def test_each_of_the_lanes_that_overlap_has_its_say() -> None:
    up = lane(box(-2, -10, 2, 10), [(0, -10), (0, 10)])
    across = lane(box(-10, -2, 10, 2), [(-10, 0), (10, 0)])
    field = RoadDirection((up, across))
    assert field.values(0.5, 1) == (NORTH, EAST)
    assert RoadDirection((across, up)).values(0.5, 1) == (EAST, NORTH), "in the order of lanes"
    assert field.values(0.5, 3) == (NORTH,)


def test_off_the_lanes_the_nearest_lane_within_reach() -> None:
    up = lane(box(-2, -10, 2, 10), [(1.9, -10), (1.9, 10)])
    down = lane(box(10, -10, 14, 10), [(13.9, 10), (13.9, -10)])
    field = RoadDirection((up, down))
    # the nearest polygon decides, not the nearest centreline
    assert field.values(6.5, 0) == (SOUTH,)
    assert field.values(6, 0) == (NORTH, SOUTH)
    assert field.values(-21.9, 0) == (NORTH,)
    assert field.values(-22.1, 0) == ()


def test_lanes_without_direction_are_passed_over() -> None:
    bare = DirectedLane(box(0, 0, 1, 1), ())
    stuck = lane(box(0, 0, 1, 1), [(0, 0), (0, 0)])
    assert RoadDirection((bare, stuck)).values(0.5, 0.5) == ()
    assert RoadDirection(()).cells((0, 0, 10, 10)) == []
    moving = lane(box(0, 0, 1, 1), [(0, 0), (0, 0), (0, 1)])
    assert RoadDirection((bare, moving)).values(0.5, 0.5) == (NORTH,)


def test_headings_southward_are_pi() -> None:
    down = lane(box(-2, -10, 2, 10), [(0, 10), (0, -10)])
    assert RoadDirection((down,)).values(0, 0) == (math.pi,)


@settings(deadline=None, max_examples=60)
@given(fields(), st.integers(0, 2**32))
def test_boxes_have_all_headings_of_their_points(field: RoadDirection, seed: int) -> None:
    rng = random.Random(seed)
    corners = np.array([(rng.uniform(-30, 30), rng.uniform(-30, 30)) for _ in range(8)])
    sizes = np.array([(rng.uniform(0, span), rng.uniform(0, span)) for span in (0, 0.1, 0.1, 1, 1, 5, 5, 20)])
    owner, heading = field.headings(np.concatenate([corners, corners + sizes], axis=1))
    assert np.all(np.diff(owner) >= 0)
    for number, (corner, size) in enumerate(zip(corners, sizes, strict=True)):
        held = heading[owner == number]
        points = corner + size * np.array([(rng.random(), rng.random()) for _ in range(40)])
        for values in field.values_many(points):
            assert all(np.any(np.abs(held - value) < 2e-9) for value in values)


def test_a_small_box_has_few_headings() -> None:
    field = along_lines([LineString([(0, 0), (0, 10), (-10, 10)])], "bend")
    assert isinstance(field, VectorField)
    owner, heading = field.headings(np.array([(0, 3, 0.1, 4), (50, 50, 51, 51), (-6, 10, -5, 10)], dtype=float))
    assert owner.tolist() == [0, 2]
    assert heading.tolist() == pytest.approx([0.0, math.pi / 2])


def test_a_polyline_is_its_own_direction() -> None:
    field = along_lines([LineString([(0, 0), (0, 10), (-10, 10)])], "bend")
    assert field.values(0, 4) == (0.0,)
    assert field.values(-4, 10) == pytest.approx((math.pi / 2,))
    assert len(field.values(0, 10)) == 2, "both segments end in the corner"


def test_a_line_against_the_traffic_is_turned_around() -> None:
    lane = DirectedLane(box(0, 0, 4, 20), (np.array([(2.0, 0.0), (2.0, 20.0)]),))
    direction = RoadDirection((lane,))
    line = LineString([(4, 15), (4, 5)])
    assert list(direction.forward(line).coords) == [(4, 5), (4, 15)]
    assert direction.forward(line.reverse()).equals_exact(line.reverse(), 0)


@settings(max_examples=60, deadline=None)
@given(fields(), st.integers(0, 10_000))
def test_a_step_along_a_lane_is_found_backwards(field: RoadDirection, seed: int) -> None:
    rng = np.random.default_rng(seed)
    paved = tuple(one.area for one in field.lanes)
    followed = FollowedDirection(field.lanes, base=field, paved=paved)
    begin = rng.uniform(-15, 15, size=(12, 2))
    steps = np.column_stack([rng.uniform(-1, 1, 12), rng.uniform(-6, 6, 12)])
    for one in (field, followed):
        pairs = [(n, heading) for n, found in enumerate(one.values_many(begin)) for heading in found]
        if not pairs:
            continue
        owner, turns = np.array([n for n, _ in pairs]), np.array([heading for _, heading in pairs])
        ends = begin[owner] + rotate_array(steps[owner], turns)
        place, heading, back = one.steps_to(ends, steps[owner])
        again = back + rotate_array(steps[owner][place], heading)
        assert np.allclose(again, ends[place], atol=1e-9), "each leads to where it is asked for"
        for n, (x, y) in enumerate(begin[owner].tolist()):
            # beside lanes a way may begin where the nearest lane's direction is: that is not looked for
            at = [lane for lane in field.lanes if lane.area.covers(Point(x, y))]
            # far from a lane's middle no way is looked for either
            within = at and all(LineString(lane.centerline[0]).distance(Point(x, y)) < 3 for lane in at)
            free = one is followed and turns[n] == OFF_ROAD and all(area.distance(Point(x, y)) > 0.06 for area in paved)
            if within or free:
                mine = place == n
                near = np.hypot(*(back[mine] - (x, y)).T) < 1e-6
                assert (near & (np.abs(heading[mine] - turns[n]) < 1e-6)).any(), (x, y, turns[n])
