"""Hidden points on curved lanes: the direction there is that of one side of a border or the other, never undecided."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from scenes import compiled
from shapely import box

from scenicq.errors import SolverError
from scenicq.geometry.features import MapFeature
from scenicq.geometry.network import Network
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT, Tolerance
from scenicq.match.verdict import Match, NoMatch
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.store.labels import Label, LabelObject

LINE = [(-3.0, -6.0), (-3.0, 5.0), (2.0, 6.0), (4.0, -6.0)]
HAIRPIN = Network(
    "hairpin",
    [
        MapFeature("road", "road", box(-9, -6, 9, 9), {"forward": "group"}),
        MapFeature("group", "lane_group", box(-9, -6, 9, 9), {"road": "road"}),
        MapFeature("lane", "lane", box(-9, -6, 9, 9), {"road": "road", "group": "group", "centerline": [list(LINE)]}),
    ],
)
FIELD = HAIRPIN.roadDirection
PROGRAM = (
    "model scenic.domains.driving.model\n"
    "spot = new OrientedPoint on network.laneRegion, facing roadDirection\n"
    "ego = new Car at spot offset by (0, Range(1, 3)), facing spot.heading\n"
)


def label(x, y, heading, ahead=2.0):
    """An ego as if its spot were at a place with a heading there."""
    place = x - ahead * math.sin(heading), y + ahead * math.cos(heading)
    return Label("frame", "recording", 0, "hairpin", LabelObject("ego", "Car", "car", *place, heading, 2.0, 4.5), ())


def beyond_borders(count):
    """Points of a guarded cell that lie on the wrong side of its border, with the heading of the cell."""
    rng, found = random.Random(7), []
    cells = [cell for cell in FIELD.cells((-9, -6, 9, 9)) if cell.guards]
    while len(found) < count:
        cell = rng.choice(cells)
        weights = np.array([rng.random() ** 2 for _ in cell.polygon])
        x, y = (weights / weights.sum()) @ cell.polygon
        values = FIELD.values(x, y)
        if all(abs(value - cell.heading) > 0.1 for value in values) and not -9 < x < -8.9:
            found.append((float(x), float(y), cell.heading, values[0]))
    return found


@pytest.fixture(scope="module", params=["portable", "dreal"])
def solver(request):
    with LazySolver(request.param) as opened:
        try:
            opened.loads()
        except SolverError as error:
            pytest.skip(error.diagnostics[0].message)
        yield opened


@pytest.mark.parametrize("method", ["auto", "smt"])
@pytest.mark.one_in(2)
def test_the_wrong_side_of_a_border_is_excluded_and_the_right_side_is_not(method, solver):
    # along the spot's line of sight the border can be crossed: the expected answer is found by walking it
    matcher = Matcher(compiled(PROGRAM, HAIRPIN), MatchOptions(tolerance=EXACT, method=method, timeout_s=20.0), solver)
    seen = set()
    for x, y, wrong, right in beyond_borders(6):
        for heading in (wrong, right):
            given = label(x, y, heading)
            reaches = any(
                any(abs(value - heading) < 1e-3 for value in FIELD.values(*spot))
                for back in np.linspace(1.0, 3.0, 801)
                if abs((spot := walked(given.ego, back))[0]) <= 9 and -6 <= spot[1] <= 9
            )
            verdict = matcher.match(given)
            assert isinstance(verdict, Match if reaches else NoMatch), (x, y, heading, verdict)
            seen.add(type(verdict))
    assert seen == {Match, NoMatch}


def walked(ego, back):
    """The spot from which an ego stands a number of metres ahead."""
    return ego.x + back * math.sin(ego.heading), ego.y - back * math.cos(ego.heading)


@pytest.mark.parametrize("offset", [-0.02, -0.002, 0.0, 0.002, 0.02])
@pytest.mark.one_in(2)
def test_the_cell_across_the_border_counts_where_the_tolerance_reaches_it(offset):
    # at y = 1 the border between the first leg and the rest lies where the direction changes
    xs = np.linspace(-3, 4, 70_001)
    values = FIELD.values_many(np.column_stack([xs, np.full_like(xs, 1.0)]))
    number = next(i for i in range(len(xs) - 1) if values[i] != values[i + 1])
    left, right = values[number][0], values[number + 1][0]
    program = (
        "model scenic.domains.driving.model\nspot = new OrientedPoint on network.laneRegion, facing roadDirection\n"
    )
    scenario = compiled(program + "ego = new Car at spot offset by (0, 0), facing spot.heading", HAIRPIN)
    matcher = Matcher(scenario, MatchOptions(tolerance=Tolerance(position=0.01, heading=1e-3)))
    for heading, near in ((left, offset <= 0.01), (right, offset >= -0.01)):
        verdict = matcher.match(label(xs[number] + offset, 1.0, heading, ahead=0.0))
        assert isinstance(verdict, Match if near else NoMatch), (offset, heading, verdict)


def gap():
    """A road whose border between directions, between a line and a point, is a parabola, which no cell follows.

    At (3.125, -2) it goes across (0.8, 0.6).
    """
    lines = [[(0.0, -9.0), (0.0, 0.0)], [(4.0, 1.0), (20.0, 1.0)]]
    area = box(-9, -9, 20, 9)
    return Network(
        "gap",
        [
            MapFeature("road", "road", area, {"forward": "group"}),
            MapFeature("group", "lane_group", area, {"road": "road"}),
            MapFeature("lane", "lane", area, {"road": "road", "group": "group", "centerline": lines}),
        ],
    )


@pytest.mark.parametrize("offset", [-0.02, -0.0101, -0.0099, 0.0, 0.0099, 0.0101, 0.02])
def test_a_curved_border_is_told_without_a_solver_however_close(offset):
    program = (
        "model scenic.domains.driving.model\nspot = new OrientedPoint on network.laneRegion, facing roadDirection\n"
    )
    scenario = compiled(program + "ego = new Car at spot offset by (0, 0), facing spot.heading", gap())
    matcher = Matcher(scenario, MatchOptions(tolerance=Tolerance(position=0.01, heading=1e-3)))
    for heading, near in ((0.0, offset <= 0.01), (-math.pi / 2, offset >= -0.01)):
        verdict = matcher.match(label(3.125 + 0.8 * offset, -2.0 + 0.6 * offset, heading, ahead=0.0))
        assert isinstance(verdict, Match if near else NoMatch), (offset, heading, verdict)


@pytest.mark.parametrize(("wide", "long"), [(0.1, 7.0), (1.0, 2.0), (2.0, 7.0), (3.0, 3.0)])
@pytest.mark.one_in(4)
def test_a_curved_border_is_told_without_a_solver_however_much_of_it_comes_into_question(wide, long):
    # the spot may be in a rectangle behind the ego, of which one corner comes closest to where it points ahead
    program = (
        "model scenic.domains.driving.model\nspot = new OrientedPoint on network.laneRegion, facing roadDirection\n"
        f"ego = new Car at spot offset by (Range(-{wide}, {wide}), Range(0, {long})), facing spot.heading"
    )
    matcher = Matcher(compiled(program, gap()), MatchOptions(tolerance=Tolerance(position=0.01, heading=1e-3)))
    for offset in (-1.0, -0.1, -0.0105, -0.0095, 0.0, 0.0095, 0.0105, 0.1, 1.0):
        given = label(3.125 + 0.8 * offset + wide, -2.0 + 0.6 * offset + long, 0.0, ahead=0.0)
        verdict = matcher.match(given)
        assert isinstance(verdict, Match if offset < 0.01 else NoMatch), (offset, verdict)


@pytest.mark.parametrize("x", [-2.6, -2.2, -1.4, -1.0, -0.8, -0.63, -0.4, 0.2])
def test_a_heading_that_is_known_narrows_what_hangs_on_it(x):
    # all places that the field is asked at have one direction; what hangs on it is no linear program: a circle
    program = (
        "F = PolylineRegion([(-40.0, 0.0), (-10.0, 30.0)]).orientation\n"
        "ego = new Object at (3, -4), facing -32 deg\nspot = (-28.7, 12.1 + Range(-1.16, 1.78))\n"
        "there = spot offset along F by (-7.76, -4.29)\n"
        "other = new Object beyond ego.position by (Range(-4.84, -2.79), -7.67) from there\n"
    )
    first, second = np.meshgrid(np.linspace(-4.84, -2.79, 400), np.linspace(-1.16, 1.78, 400))
    spot = np.stack([np.full_like(second, -28.7), 12.1 + second]) + turned(-7.76, -4.29, -math.pi / 4)[:, None, None]
    ahead = np.array([3.0, -4.0])[:, None, None] - spot
    place = np.array([3.0, -4.0])[:, None, None] + turned(first, -7.67, np.arctan2(-ahead[0], ahead[1]))
    away = np.hypot(place[0] - x, place[1] - 3.55).min()
    assert abs(away - 0.25) > 0.02
    ego = LabelObject("ego", "Object", "object", 3.0, -4.0, math.radians(-32), 1.0, 1.0)
    other = LabelObject("other", "Object", "object", x, 3.55, None, 1.0, 1.0)
    matcher = Matcher(compiled(program, HAIRPIN), MatchOptions(tolerance=Tolerance(position=0.25, heading=0.1)))
    verdict = matcher.match(Label("frame", "recording", 0, "hairpin", ego, (other,)))
    assert isinstance(verdict, Match if away < 0.25 else NoMatch), (away, verdict)


def turned(x, y, angle):
    """A vector turned by an angle in radians."""
    return np.stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)])
