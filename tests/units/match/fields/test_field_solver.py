"""Chains along fields: enclosures lose no value, all ways through an intersection are looked at, and soon."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np
import pytest
from conditioned_groups import groups
from hidden_roads import CHAIN
from scenes import STREET, compiled, drawn, label_of

from scenicq.forest.nodes import PointIn
from scenicq.forest.walk import leaves
from scenicq.match.decide.decomposition import decide_decomposed
from scenicq.match.fields import cell_assignment, field_solver, interval_domain
from scenicq.match.fields.field_solver import repair_solution
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.evaluation import replay
from scenicq.match.problem.outcome import Satisfied
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Match, NoMatch

CASES = 400


def interval(rng, widest):
    low = rng.uniform(-widest, widest, CASES)
    return np.stack([low, low + rng.choice([0.0, 0.01, 1.0, widest], CASES) * rng.random(CASES)])


def inside(rng, limits):
    return limits[..., 0, :] + rng.random(limits[..., 0, :].shape) * (limits[..., 1, :] - limits[..., 0, :])


def holds(limits, value):
    return bool(((limits[..., 0, :] <= value + 1e-9) & (value <= limits[..., 1, :] + 1e-9)).all())


def test_enclosures_hold_what_they_enclose():
    rng = np.random.default_rng(3)
    for _ in range(20):
        a, b = interval(rng, 4.0), interval(rng, 4.0)
        box, angle = np.stack([interval(rng, 4.0), interval(rng, 4.0)]), interval(rng, 4.0)
        x, y, point, turn = inside(rng, a), inside(rng, b), inside(rng, box), inside(rng, angle)
        assert holds(interval_domain.subtract(a, b), x - y)
        assert holds(interval_domain.times(a, b), x * y)
        assert holds(interval_domain.divide(a, b), x / y)
        s, c = np.sin(turn), np.cos(turn)
        turned = np.stack([point[0] * c - point[1] * s, point[0] * s + point[1] * c])
        assert holds(interval_domain.rotate(box, interval_domain.turning(angle)), turned)
        headings = interval_domain.angle_of(box)
        known = np.isfinite(headings[0])
        headings = headings[:, known]
        off = np.arctan2(-point[0], point[1])[known] - headings.mean(axis=0)
        near = np.remainder(off + math.pi, math.tau) - math.pi
        assert (np.abs(near) <= (headings[1] - headings[0]) / 2 + 1e-9).all()
        shifted = interval_domain.turns_near(a + math.tau * rng.integers(-3, 4, CASES), b)
        meets = np.abs(np.remainder(x - y + math.pi, math.tau) - math.pi) < 1e-12
        assert holds(shifted[:, meets], y[meets])


def test_enclosures_of_points_are_points():
    zero, one = np.zeros((2, 1)), np.ones((2, 1))
    quarter = interval_domain.turning(np.full((2, 1), math.pi / 2))
    assert interval_domain.rotate(np.stack([zero, one]), quarter)[..., 0] == pytest.approx(np.array([[-1, -1], [0, 0]]))
    assert interval_domain.find_empty(interval_domain.common(one, one + 1)).tolist() == [True]
    assert np.isinf(interval_domain.divide(one, zero)).all()


@pytest.mark.parametrize("beside", [-6e-20, 6e-20, -1e-12])
def test_a_box_that_covers_almost_half_a_turn_has_any_heading(beside):
    """Seen from a place next to a long side, rounding does not tell whether it passes ahead or behind."""
    box = np.array([[[-14.5], [9.7]], [[beside], [beside]]])
    low, high = interval_domain.angle_of(box)[:, 0]
    for x in (-14.5, -1e-19, 1e-16, 9.7):
        heading = math.atan2(-x, beside)
        assert any(low <= heading + turn <= high for turn in (-math.tau, 0.0, math.tau))


@pytest.mark.parametrize(("cars", "labels"), [(1, 3), pytest.param(3, 6, marks=pytest.mark.slow)])
def test_chains_through_an_intersection_are_decided_without_a_solver(cars, labels):
    scenario = compiled("model scenic.domains.driving.model\n" + CHAIN.format(cars=cars), STREET)
    matcher = Matcher(scenario, MatchOptions(tolerance=EXACT, enforce=frozenset()))
    for seed in range(labels):
        label = label_of(scenario, drawn(scenario, seed), random.Random(seed), distractors=1)
        assert isinstance(matcher.match(label), Match)
        last = next(thing for thing in label.objects if thing.id == f"object-{cars}")
        away = replace(last, x=last.x + 30.0, y=last.y + 25.0)
        pushed = replace(label, objects=tuple(away if thing is last else thing for thing in label.objects))
        assert isinstance(matcher.match(pushed), NoMatch)


@pytest.mark.slow
def test_cells_of_one_box_are_looked_for_once(monkeypatch):
    asked = []

    def watched(field, heading, box):
        asked.append((id(field), heading, box))
        return real(field, heading, box)

    real = cell_assignment._cells_in
    monkeypatch.setattr(cell_assignment, "_cells_in", watched)
    monkeypatch.setattr(field_solver, "find_witness", lambda *_, **__: None)
    tolerance, most = MatchOptions(tolerance=EXACT).tolerance, 0
    for seed in range(6):
        for items, _ in groups(CHAIN.format(cars=1), seed):
            asked.clear()
            decide_decomposed(items, tolerance)
            assert len(set(asked)) == len(asked)
            most = max(most, len(asked))
    assert most > 1


@pytest.mark.slow
def test_what_misses_a_solution_by_little_is_repaired():
    rng, tolerance, count = random.Random(5), MatchOptions(tolerance=EXACT).tolerance, 0
    for seed in range(4):
        for items, true in groups(CHAIN.format(cars=1), seed):
            found = decide_decomposed(items, tolerance) if true and leaves(*(node for _, node, _ in items)) else None
            if not isinstance(found, Satisfied) or any(
                isinstance(leaf, PointIn) for leaf in leaves(*(i[1] for i in items))
            ):
                continue
            numbers = {leaf.identity for leaf in leaves(*(node for _, node, _ in items)) if hasattr(leaf, "low")}
            off = {
                key: value + rng.uniform(-0.02, 0.02) if key in numbers else value
                for key, value in found.values.items()
            }
            again = repair_solution(items, off, tolerance)
            assert again is not None
            assert replay(items, again.values, tolerance, 1e-6)
            # a solver leaves out what it did not need
            for key in numbers:
                some = repair_solution(items, {each: value for each, value in off.items() if each != key}, tolerance)
                assert some is None or replay(items, some.values, tolerance, 1e-6)
            far = {key: value + 1.0 if key in numbers else value for key, value in found.values.items()}
            count += repair_solution(items, far, tolerance) is None
    assert count
