"""Boxes in regions that are not convex: the formula against shapely, on boxes placed at random and on borders."""

from __future__ import annotations

import math

import pytest
from built_in import check
from formulas import Var, Variable, evaluate
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon
from shapely import box as rectangle

from scenicq.errors import CannotEvaluate
from scenicq.forest.compute import covers
from scenicq.geometry.boxes import box_polygon
from scenicq.geometry.regions import (
    DifferenceOf,
    Disc,
    Everywhere,
    IntersectionOf,
    Nowhere,
    PolygonSet,
    Rectangle,
    Region,
    UnionOf,
)
from scenicq.smt.answer import Sat, Unsat
from scenicq.smt.distance_terms import BoxTerms
from scenicq.smt.enclosing import box_holds
from scenicq.smt.problem import Problem
from scenicq.smt.terms import negation, number

ELL = Polygon([(0, 0), (12, 0), (12, 5), (5, 5), (5, 12), (0, 12)])
YARD = Polygon([(-9, -9), (9, -9), (9, 9), (-9, 9)], [[(-1, -1), (-1, 1), (1, 1), (1, -1)]])
REGIONS: dict[str, Region] = {
    "ell": PolygonSet((ELL,), "ell"),
    "around a hole": PolygonSet((YARD,), "yard"),
    "two that share a side": PolygonSet((rectangle(-10, -4, 0, 4), rectangle(0, -4, 10, 4)), "halves"),
    "two that overlap": UnionOf((PolygonSet((rectangle(-10, -4, 2, 4),), "a"), PolygonSet((ELL,), "b"))),
    "two apart": PolygonSet((rectangle(-10, -4, -1, 4), rectangle(1, -4, 10, 4)), "apart"),
    "cut by a disc": IntersectionOf((PolygonSet((ELL,), "ell"), Disc((4.0, 4.0), 6.0))),
    "disc": Disc((1.0, 1.0), 7.0),
    "rectangle": Rectangle((1.0, 0.0), 0.4, 12.0, 15.0),
    "anywhere": Everywhere(),
}
PLANE = ((-math.inf, math.inf), (-math.inf, math.inf))


def frame(x: float, y: float, heading: float, width: float, length: float) -> BoxTerms:
    return BoxTerms.of((number(x), number(y)), number(heading), number(width), number(length))


def decided(x: float, y: float, heading: float, width: float, length: float, region: Region) -> bool:
    """What shapely says of a box and of one a little larger or smaller; None on the border."""
    return covers(region, box_polygon(x, y, heading, width, length))


places = st.floats(-11, 13).map(lambda number: round(number, 2))


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(sorted(REGIONS)), places, places, st.floats(-4, 4), st.floats(0.2, 5), st.floats(0.2, 5))
def test_the_formula_says_what_shapely_says(
    name: str, x: float, y: float, heading: float, width: float, length: float
) -> None:
    region = REGIONS[name]
    inner, outer = (decided(x, y, heading, width + more, length + more, region) for more in (-1e-6, 1e-6))
    if inner != outer:
        # on the border, rounding decides
        return
    around = ((x - 5, x + 5), (y - 5, y + 5))
    for where in (around, PLANE):
        assert evaluate(box_holds(frame(x, y, heading, width, length), region, where), {}) == inner


def test_a_solver_finds_the_place_in_a_bend_and_that_there_is_none() -> None:
    # a box 4 m by 4 m, turned by 45 degrees, fits into the corner of the ell, but not into its arms
    x, y = Var("x"), Var("y")
    region = REGIONS["ell"]
    for sizes, ranges, expected in (
        ((4.0, 4.0), (0.0, 12.0), Sat),
        ((4.0, 4.0), (6.0, 12.0), Unsat),
        ((8.0, 8.0), (0.0, 12.0), Unsat),
    ):
        box = BoxTerms.of((x, y), number(math.pi / 4), number(sizes[0]), number(sizes[1]))
        problem = Problem((Variable("x", *ranges), Variable("y", 0.0, 12.0)), box_holds(box, region, PLANE))
        answer = check(problem, precision=1e-4, timeout_s=20.0)
        assert isinstance(answer, expected), (sizes, answer)
        if isinstance(answer, Sat):
            found = box_polygon(answer.witness["x"], answer.witness["y"], math.pi / 4, 3.99, 3.99)
            assert ELL.covers(found)


def test_what_does_not_hold_a_box_is_a_formula_too() -> None:
    outside = negation(box_holds(frame(6.0, 6.0, 0.0, 1.0, 1.0), REGIONS["ell"], PLANE))
    assert evaluate(outside, {})
    assert not evaluate(box_holds(frame(0.0, 0.0, 0.0, 1.0, 1.0), Nowhere(), PLANE), {})


@pytest.mark.parametrize(
    "region",
    [
        DifferenceOf(REGIONS["ell"], Disc((0.0, 0.0), 1.0)),
        UnionOf((REGIONS["ell"], Disc((0.0, 0.0), 1.0))),
        PolygonSet((Polygon([(9 * math.cos(a / 99), 9 * math.sin(a / 99)) for a in range(622)] + [(0, 0)]),), "gear"),
    ],
)
def test_what_cannot_be_said_is_refused_with_a_reason(region: Region) -> None:
    with pytest.raises(CannotEvaluate, match="whether a random box lies in"):
        box_holds(frame(0.0, 0.0, 0.0, 1.0, 1.0), region, PLANE)
