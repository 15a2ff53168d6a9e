"""Steps of the cascade against dense sampling, and their edges: the seam, zero tolerance, boxes and discs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from comparisons import DEFAULT, between, c, compared
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely import LineString, Polygon

from scenicq.forest import build
from scenicq.forest.nodes import (
    ArithmeticOp,
    Constant,
    DiscreteRange,
    Index,
    Normal,
    PointIn,
    Select,
)
from scenicq.geometry.regions import Disc, PointSet, PolygonSet, PolylineSet, Rectangle, intersection, union
from scenicq.match.decide.cascade import decide
from scenicq.match.decide.solver_step import ask
from scenicq.match.options import MatchOptions
from scenicq.match.problem.evaluation import replay
from scenicq.match.problem.outcome import Refuted, Satisfied, Undecided
from scenicq.match.tolerance import EXACT, Tolerance

small = st.floats(-20, 20).map(lambda x: round(x, 2))
angles = st.floats(-7, 7).map(lambda x: round(x, 2))
widths = st.sampled_from([0.0, 0.05, 0.7])


def check(items, tolerance=DEFAULT):
    """Decide, and replay the witness of a yes."""
    outcome = decide(items, tolerance)
    if isinstance(outcome, Satisfied):
        assert replay(items, outcome.values, tolerance, 1e-6)
    return outcome


@settings(max_examples=200, deadline=None)
@given(small, small, small, small, small, widths)
def test_a_number_is_reached_where_sampling_says_so(a, b, factor, offset, observed, width):
    node = build.add(build.arithmetic(ArithmeticOp.MUL, between(a, b), c(factor)), c(offset))
    values = offset + factor * np.linspace(min(a, b), max(a, b), 4001)
    gap = np.abs(values - observed).min()
    step = abs(factor * (b - a)) / 4000
    # on the edge of the tolerance rounding decides
    assume(gap <= width - 1e-8 or gap > width + step + 1e-8)
    outcome = check([compared("speed", node, observed)], Tolerance(other=width))
    assert isinstance(outcome, Satisfied if gap <= width else Refuted)


@settings(max_examples=200, deadline=None)
@given(angles, angles, angles, angles, widths)
def test_a_heading_is_reached_modulo_whole_turns(a, b, offset, observed, width):
    node = build.add(between(a, b), c(offset))
    values = offset + np.linspace(min(a, b), max(a, b), 4001)
    gap = np.abs((values - observed + math.pi) % math.tau - math.pi).min()
    assume(abs(gap - width) > 0.01)
    outcome = check([compared("heading", node, observed)], Tolerance(heading=width))
    assert isinstance(outcome, Satisfied if gap < width else Refuted)


@pytest.mark.parametrize("observed", [math.pi, -math.pi, 3.13, -3.13])
def test_the_seam_loses_no_match(observed):
    node = build.add(between(-0.05, 0.05), c(math.pi))
    assert isinstance(check([compared("heading", node, observed)]), Satisfied)


PARTS = st.lists(st.tuples(small, small, st.booleans()), min_size=1, max_size=3)


@settings(max_examples=150, deadline=None)
@given(small, small, angles, PARTS, small, small, st.booleans(), widths)
def test_a_position_is_reached_where_sampling_says_so(x, y, heading, parts, seen_x, seen_y, boxed, width):
    offsets = [between(a, b) for a, b, _ in parts]
    side = [node for node, (_, _, across) in zip(offsets, parts, strict=True) if across]
    front = [node for node, (_, _, across) in zip(offsets, parts, strict=True) if not across]

    def total(nodes):
        found = c(0.0)
        for node in nodes:
            found = build.add(found, node)
        return found

    node = build.offset_local(c((x, y)), c(heading), build.vector(total(side), total(front)))
    limits = [
        [
            sum(min(a, b) for a, b, across in parts if across == wanted),
            sum(max(a, b) for a, b, across in parts if across == wanted),
        ]
        for wanted in (True, False)
    ]
    grid = np.stack(np.meshgrid(*(np.linspace(*pair, 301) for pair in limits)), axis=-1).reshape(-1, 2)
    cos, sin = math.cos(heading), math.sin(heading)
    places = np.column_stack([x + grid[:, 0] * cos - grid[:, 1] * sin, y + grid[:, 0] * sin + grid[:, 1] * cos])
    off = np.abs(places - (seen_x, seen_y))
    gap = off.max(axis=1).min() if boxed else np.hypot(off[:, 0], off[:, 1]).min()
    coarse = 0.75 * sum(high - low for low, high in limits) / 300 + 0.01
    assume(gap <= width or gap > width + coarse)
    tolerance = Tolerance(x=width, y=width) if boxed else Tolerance(position=width)
    assert isinstance(
        check([compared("position", node, (seen_x, seen_y))], tolerance), Satisfied if gap <= width else Refuted
    )


REGIONS = {
    "polygon": PolygonSet((Polygon([(0, 0), (10, 0), (10, 4), (4, 4), (4, 10), (0, 10)]),), "ell"),
    "lines": PolylineSet((LineString([(0, 0), (10, 0), (10, 10)]),), "curb"),
    "points": PointSet(((0.0, 0.0), (5.0, 5.0)), "spots"),
    "disc": Disc((3.0, 3.0), 4.0),
    "both": union(PolylineSet((LineString([(0, 5), (10, 5)]),), "line"), PointSet(((2.0, 2.0),), "spot")),
    "cut": intersection(PolygonSet((Polygon([(0, 0), (10, 0), (10, 10), (0, 10)]),), "square"), Disc((0.0, 0.0), 6.0)),
}
INSIDE = {
    "polygon": [(1.0, 9.0), (9.0, 1.0)],
    "lines": [(5.0, 0.0), (10.0, 7.0)],
    "points": [(0.0, 0.0), (5.0, 5.0)],
    "disc": [(3.0, 6.9), (0.5, 3.0)],
    "both": [(4.0, 5.0), (2.0, 2.0)],
    "cut": [(4.0, 4.0), (0.0, 5.9)],
}
OUTSIDE = {
    "polygon": [(9.0, 9.0), (-1.0, 2.0)],
    "lines": [(5.0, 1.0), (9.0, 9.0)],
    "points": [(0.1, 0.0), (2.5, 2.5)],
    "disc": [(3.0, 7.2), (8.0, 8.0)],
    "both": [(4.0, 5.5), (2.0, 2.4)],
    "cut": [(4.5, 4.5), (-0.5, 3.0)],
}


@pytest.mark.parametrize("kind", REGIONS)
@pytest.mark.parametrize("shared", [False, True])
def test_a_point_in_a_region_by_every_step(kind, shared):
    # The point alone is inverted; together with a second one at a random distance it takes a linear program.
    spot = PointIn(c(REGIONS[kind]))
    gap = between(1.0, 2.0)
    for places, expected in ((INSIDE[kind], Satisfied), (OUTSIDE[kind], Refuted)):
        for x, y in places:
            items = [compared("position", spot, (x, y))]
            if shared:
                ahead = build.offset_local(spot, c(0.3), build.vector(c(0.0), gap))
                seen = (x - 1.5 * math.sin(0.3), y + 1.5 * math.cos(0.3))
                items.append(compared("position", ahead, seen))
            outcome = check(items)
            if isinstance(outcome, Undecided):
                assert kind == "disc"
            else:
                assert isinstance(outcome, expected), (x, y, outcome)
            assert isinstance(ask([items], MatchOptions(tolerance=EXACT), None), expected), (x, y)


def test_two_positions_of_one_spot_must_agree():
    spot = PointIn(c(REGIONS["lines"]))
    one = build.offset_local(spot, c(0.0), build.vector(c(1.0), c(0.0)))
    other = build.offset_local(spot, c(0.0), build.vector(c(-1.0), c(0.0)))
    together = [compared("position", one, (6.0, 0.0)), compared("position", other, (4.0, 0.0))]
    apart = [compared("position", one, (6.0, 0.0)), compared("position", other, (3.0, 0.0))]
    assert isinstance(check(together), Satisfied)
    assert isinstance(check(apart), Refuted)


def test_zero_tolerance_is_membership():
    zero = Tolerance(position=0.0, heading=0.0, other=0.0)
    node = build.offset_local(c((0.1, 0.2)), c(0.7), build.vector(c(0.0), between(1, 3)))
    on = (0.1 - 2 * math.sin(0.7), 0.2 + 2 * math.cos(0.7))
    assert isinstance(check([compared("position", node, on)], zero), Satisfied)
    assert isinstance(check([compared("position", node, (on[0] + 1e-5, on[1]))], zero), Refuted)
    assert isinstance(
        check([compared("heading", build.add(c(0.1), between(0.0, 0.2)), 0.30000000000000004)], zero), Satisfied
    )


def test_an_unbounded_offset_reaches_its_line_and_nothing_else():
    node = build.offset_local(c((0.0, 0.0)), c(0.5), build.vector(c(0.0), Normal(c(3.0), c(1.0))))
    far = (-1e5 * math.sin(0.5), 1e5 * math.cos(0.5))
    assert isinstance(check([compared("position", node, far)]), Satisfied)
    assert isinstance(check([compared("position", node, (far[0] + 0.1, far[1]))]), Refuted)


def test_discrete_choices_are_tried_one_by_one():
    pick = Select(Index((1.0, 1.0)), (c(2.0), c(5.0)))
    count = DiscreteRange(c(1.0), c(3.0))
    node = build.arithmetic(ArithmeticOp.MUL, pick, count)
    for observed, expected in ((10.0, Satisfied), (6.0, Satisfied), (8.0, Refuted)):
        assert isinstance(check([compared("speed", node, observed)]), expected)


def test_the_choice_that_decides_which_others_matter_is_made_first():
    inner = [Select(Index((1.0, 1.0)), (c(float(number)), c(number + 0.5))) for number in range(900)]
    outer = Index((1.0,) * len(inner))
    node = Select(outer, tuple(inner))
    # the outer choice is asked elsewhere too, so that the inner ones do not become one list
    also = compared("speed", Select(outer, tuple(c(float(number % 2)) for number in range(len(inner)))), 1.0)
    for observed, expected in ((701.5, Satisfied), (700.5, Refuted), (2000.0, Refuted)):
        assert isinstance(check([compared("width", node, observed), also]), expected)


def test_a_witness_needs_no_value_of_what_is_not_picked():
    node = Select(Index((1.0, 1.0)), (between(0, 1), between(5, 6)))
    assert isinstance(check([compared("width", node, 5.5)]), Satisfied)
    assert isinstance(check([compared("width", node, 3.0)]), Refuted)


def test_what_cancels_out_has_a_value_all_the_same():
    gap, shift = between(2, 3), between(0, 1)
    node = build.arithmetic(ArithmeticOp.ADD, build.arithmetic(ArithmeticOp.SUB, gap, gap), shift)
    outcome = check([compared("width", node, 0.5)])
    assert isinstance(outcome, Satisfied)
    assert 2 <= outcome.values[gap.identity] <= 3
    assert isinstance(check([compared("width", node, 1.5)]), Refuted)


@pytest.mark.slow
def test_very_many_choices_are_left_to_a_solver():
    picks = [Select(Index((1.0, 1.0)), (c(1.0), c(1.5))) for _ in range(400)]
    total = picks[0]
    for each in picks[1:]:
        total = build.arithmetic(ArithmeticOp.ADD, total, each)
    assert isinstance(decide([compared("width", total, 450.25)], DEFAULT), Undecided)


def test_distance_to_a_region_and_boxes_in_the_solver():
    from scenicq.forest.groups import Condition
    from scenicq.forest.nodes import Compare, CompareOp, Distance, Encloses, Intersects, RectangleAt
    from scenicq.forest.scenario import Requirement

    spot = PointIn(c(Rectangle((0.0, 0.0), 0.0, 4.0, 4.0)))
    at = compared("position", build.vector_sum(spot, build.vector(between(0.0, 1.0), c(0.0))), (2.5, 0.0))

    def verdict(condition):
        return type(
            ask(
                [[at, (Condition(Requirement(condition, None), condition), condition, None)]],
                MatchOptions(tolerance=EXACT),
                None,
            )
        )

    region = c(PolygonSet((Polygon([(4, -5), (9, -5), (9, 5), (4, 5)]),), "wall"))
    away = Distance(region, spot)
    assert verdict(Compare(CompareOp.LT, away, c(2.2))) is Satisfied
    assert verdict(Compare(CompareOp.LT, away, c(1.9))) is Refuted
    box = RectangleAt(spot, between(0.0, 0.1), c(2.0), c(4.0))
    assert verdict(Intersects(box, region)) is Refuted
    wide = RectangleAt(spot, between(1.0, 1.6), c(2.0), c(4.2))
    assert verdict(Intersects(wide, region)) is Satisfied
    assert verdict(Intersects(box, c(Rectangle((3.5, 0.0), 0.0, 1.5, 2.0)))) is Satisfied
    assert verdict(Intersects(box, c(Disc((5.0, 0.0), 1.5)))) is Refuted
    assert verdict(Encloses(c(Disc((1.5, 0.0), 3.5)), box)) is Satisfied
    assert verdict(Encloses(c(Disc((1.5, 0.0), 1.0)), box)) is Refuted


def test_a_choice_of_words_in_the_solver():
    weather = Select(Index((1.0, 2.0)), (Constant("sun"), Constant("rain")))
    for observed, expected in (("rain", Satisfied), ("sun", Satisfied), ("snow", Refuted)):
        items = [compared("weather", weather, observed)]
        assert isinstance(ask([items], MatchOptions(tolerance=EXACT), None), expected)
        assert isinstance(decide(items, EXACT), expected)
    for observed in (True, False):
        items = [compared("lit", Select(Index((1.0, 1.0)), (c(True), c(True))), observed)]
        assert isinstance(ask([items], MatchOptions(tolerance=EXACT), None), Satisfied if observed else Refuted)
