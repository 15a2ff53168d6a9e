"""Parts with one number in common: where linear programs let it be, and that a value for all of them is found."""

from __future__ import annotations

import random

import numpy as np
import pytest
from comparisons import between, c, compared
from conditioned_groups import groups

from scenicq.forest import build
from scenicq.forest.bounds import scalar_bounds
from scenicq.forest.condition import condition
from scenicq.forest.nodes import ArithmeticOp
from scenicq.forest.walk import leaves
from scenicq.match.decide.decomposition import decide_decomposed
from scenicq.match.fields import field_solver
from scenicq.match.fields.shared_variable import find_shared_value, joined
from scenicq.match.linear.linear_relaxation import extent_affine
from scenicq.match.problem.evaluation import replay
from scenicq.match.problem.outcome import Refuted, Satisfied
from scenicq.match.tolerance import Tolerance

CROSSING = """
ego = new Car on intersection
shift = Range(-0.5, 0.5)
last = ego
for i in range({cars}):
    base = new OrientedPoint at (front of last) offset by (0, Range(2, 6)), facing roadDirection
    last = new Car at base offset by (shift, 1), facing Range(-5, 5) deg relative to base.heading
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
    assert joined([(3.0, 4.0), (0.0, 1.0), (0.5, 2.0), (2.0, 2.5)]) == [(0.0, 2.5), (3.0, 4.0)]


@pytest.fixture
def asked(monkeypatch):
    """How many ways the parts had that were put together; no witness is found by trial before."""
    counts = []
    monkeypatch.setattr(field_solver, "probed", lambda start, tolerance: None)

    def counted(parts, *rest):
        counts.append([len(ways) for ways in parts])
        return find_shared_value(parts, *rest)

    monkeypatch.setattr(field_solver, "find_shared_value", counted)
    return counts


def test_one_shift_suits_all_cars_exactly_where_some_value_of_it_does(asked):
    # one car is moved aside: alone it may have a shift, but perhaps not that of the others
    tolerance, rng, told = Tolerance(position=0.05, heading=0.02), random.Random(3), []
    for seed in range(4):
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
