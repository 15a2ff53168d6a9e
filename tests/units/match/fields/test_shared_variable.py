"""Parts with one number in common: where linear programs let it be, and that a value for all of them is found."""

from __future__ import annotations

import itertools
import random
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from comparisons import between, c, compared
from conditioned_groups import groups

from scenicq.forest import build
from scenicq.forest.bounds import scalar_bounds
from scenicq.forest.condition import condition
from scenicq.forest.nodes import ArithmeticOp, Constant, DirectionAt, VectorOf
from scenicq.forest.walk import leaves
from scenicq.match.decide.decomposition import decide_decomposed
from scenicq.match.fields import field_solver, shared_variable
from scenicq.match.fields.shared_variable import find_shared_value, join_intervals
from scenicq.match.linear.linear_relaxation import extent_affine
from scenicq.match.problem.evaluation import replay
from scenicq.match.problem.outcome import Refuted, Satisfied, Undecided, finish
from scenicq.match.tolerance import EXACT, Tolerance

from .patchwork import HEADINGS, SIDE, Beside, patchwork

CROSSING = """
ego = new Car on intersection
shift = Range(-0.5, 0.5)
last = ego
for i in range({cars}):
    base = new OrientedPoint at (front of last) offset by (0, Range(2, 6)), facing roadDirection
    last = new Car at base offset by (shift, 1), facing Range(-60, 60) deg relative to base.heading
"""


def test_the_extent_of_a_number_is_that_of_the_equation():
    rng, met = random.Random(4), set()
    for _ in range(200):
        low, factor, seen, allowed = rng.uniform(-3, 3), rng.choice([-2.0, 0.5, 3.0]), rng.uniform(-9, 9), rng.random()
        number, other = between(low, low + 2.0), between(-1.0, 1.0)
        node = build.add(build.arithmetic(ArithmeticOp.MUL, number, c(factor)), other)
        found = extent_affine([compared("speed", node, seen)], [], Tolerance(other=allowed), [], [], number.identity)
        ends = sorted((seen + sign * (1.0 + allowed)) / factor for sign in (-1, 1))
        expected = max(low, ends[0]), min(low + 2.0, ends[1])
        met.add(found is None)
        if abs(expected[1] - expected[0]) > 1e-6:
            assert (found is None) is (expected[0] > expected[1])
        if found is not None:
            assert found == pytest.approx(expected, abs=1e-6)
    assert met == {True, False}


def test_intervals_that_meet_are_one():
    assert join_intervals([(3.0, 4.0), (0.0, 1.0), (0.5, 2.0), (2.0, 2.5)]) == [(0.0, 2.5), (3.0, 4.0)]


@pytest.fixture
def asked(monkeypatch):
    """How many ways the parts had that were put together; no witness is found by trial before."""
    counts = []
    monkeypatch.setattr(field_solver, "find_witness", lambda *_, **__: None)

    def counted(parts, *rest):
        counts.append([len(ways) for ways in parts])
        return find_shared_value(parts, *rest)

    monkeypatch.setattr(field_solver, "find_shared_value", counted)
    return counts


@pytest.mark.parametrize("exact", list(itertools.product([True, False], repeat=2)))
def test_a_way_without_a_solution_excludes_only_if_its_program_is_exact(monkeypatch, exact):
    # no linear program has a solution, of which an inexact one proves nothing
    found = []
    monkeypatch.setattr(field_solver, "find_witness", lambda *_, **__: None)
    monkeypatch.setattr(
        field_solver, "find_shared_value", lambda *given: found.append(given) or find_shared_value(*given)
    )
    items = next(items for items, true in groups(CROSSING.format(cars=3), 1) if true and len(items) >= 6)
    decide_decomposed(items, Tolerance(position=0.05, heading=0.02))
    parts, *rest = found[0]
    ways = [replace(part[0], exact=one, vague=[]) for part, one in zip(parts, exact, strict=False)]
    limits = next(each.limits for each in ways)
    ways = [[replace(way, limits=limits)] for way in ways]
    monkeypatch.setattr(
        shared_variable, "solve_cells", lambda way, *_: Undecided(way.case.network.items[0][0], "nonlinear")
    )
    monkeypatch.setattr(shared_variable, "extent", lambda *_: None)
    outcome = find_shared_value(ways, *rest)
    # the first part is asked first, and is the one that has nothing left
    assert isinstance(outcome, Refuted if exact[0] else Undecided)


@pytest.mark.slow
def test_one_shift_suits_all_cars_exactly_where_some_value_of_it_does(asked):
    # one car is moved aside: alone it may have a shift, but perhaps not that of the others
    tolerance, rng, told = Tolerance(position=0.05, heading=0.02), random.Random(3), []
    for seed in range(6):
        for items, true in groups(CROSSING.format(cars=3), seed):
            known = leaves(*(node for _, node, _ in items))
            shift = next((leaf.identity for leaf in known if scalar_bounds(leaf) == (-0.5, 0.5)), None)
            if not true or len(items) < 6 or shift is None:
                continue
            at = rng.choice([n for n, (each, _, _) in enumerate(items) if each.property == "position"])
            constraint, node, (x, y) = items[at]
            for by in (0.0, 0.06, 0.12):
                moved = [*items]
                moved[at] = (constraint, node, (x + by, y - by))
                outcome = decide_decomposed(moved, tolerance)
                told.append(type(outcome))
                if isinstance(outcome, Satisfied):
                    assert replay(moved, outcome.values, tolerance, 1e-6)
                    continue
                assert by
                for value in np.linspace(-0.5, 0.5, 21):
                    given = {shift: float(value)}
                    single = [(each, condition(node, {}, given), seen) for each, node, seen in moved]
                    assert not isinstance(decide_decomposed(single, tolerance), Satisfied)
    assert {Refuted, Satisfied} <= set(told)
    assert max(map(len, asked)) == 3
    assert max(map(max, asked)) > 1


def blamed(outcome, parts):
    """Whether what is to blame is one of the constraints."""
    return any(outcome.constraint is constraint for part in parts for constraint, _, _ in part)


@pytest.mark.parametrize("far", [3.0, 12.0])
@pytest.mark.one_in(2)
def test_parts_suit_each_other_exactly_where_arithmetic_says_so(far, monkeypatch):
    monkeypatch.setattr(field_solver, "find_witness", lambda *_, **__: None)
    rng, met = random.Random(1), Counter()
    for _ in range(18):
        field, value = patchwork(rng, 4), rng.uniform(0.5, 5.5)
        cars = [Beside(field, rng.uniform(0.0, 3 * SIDE - 2.0), number, far) for number in range(rng.choice((2, 3)))]
        # each of them alone can be as it is seen; together perhaps
        seen = [car.seen(rng.choice((value, value, rng.uniform(0.0, 6.0))), rng) for car in cars]
        shared = between(0.0, 6.0)
        parts = [car.items(shared, each) for car, each in zip(cars, seen, strict=True)]
        outcome = finish(field_solver.search_directions(parts, shared.identity, EXACT))
        may, must = (
            any(
                max(low for low, _ in some) <= min(high for _, high in some)
                for some in itertools.product(
                    [(0.0, 6.0)], *(car.allowed(each, slack) for car, each in zip(cars, seen, strict=True))
                )
            )
            for slack in (0.01, -0.01)
        )
        if isinstance(outcome, Satisfied):
            assert may
            assert replay([item for part in parts for item in part], outcome.values, EXACT, 1e-6)
        else:
            assert isinstance(outcome, Refuted)
            assert not must
            assert blamed(outcome, parts)
        met[type(outcome)] += 1
    assert min(met[Satisfied], met[Refuted]) > 3


def test_parts_that_ask_for_one_direction_get_one(monkeypatch):
    told = []
    monkeypatch.setattr(field_solver, "find_witness", lambda *_, **__: None)

    def noted(*args):
        told.append(find_shared_value(*args))
        return told[-1]

    monkeypatch.setattr(field_solver, "find_shared_value", noted)
    rng, met = random.Random(2), set()
    for _ in range(30):
        field, shared = patchwork(rng, 4), between(0.0, 4 * SIDE)
        heading = DirectionAt(Constant(field), VectorOf(shared, c(rng.uniform(0.1, 3.9))))
        parts = [[compared("heading", build.add(heading, between(-0.1, 0.1)), rng.choice(HEADINGS))] for _ in range(2)]
        outcome = finish(field_solver.search_directions(parts, shared.identity, EXACT))
        one, other = (part[0][2] for part in parts)
        assert isinstance(outcome, Satisfied if one == other and one in field.tiles[:, 0] else Refuted)
        if isinstance(outcome, Satisfied):
            assert replay([*parts[0], *parts[1]], outcome.values, EXACT, 1e-6)
        assert all(isinstance(each, Satisfied) or blamed(each, parts) for each in told)
        met |= {type(outcome), *map(type, told)}
        told.clear()
    # that the parts do not agree on the direction is not known before all are put together
    assert met == {Satisfied, Refuted, Undecided}
