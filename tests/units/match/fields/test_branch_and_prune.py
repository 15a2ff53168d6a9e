"""Groups are decided by boxes: witnesses hold, nothing that has a solution is refuted, limits leave it undecided."""

from __future__ import annotations

import math
import random
import sys
from pathlib import Path

import pytest
import shapely

sys.path.insert(0, str(Path(__file__).parent))
from random_expressions import RATIONAL, random_expression

from scenicq.forest import build
from scenicq.forest.evaluate import evaluate
from scenicq.forest.groups import Comparison, Condition
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    CompareOp,
    Constant,
    Contains,
    DiscAt,
    DiscreteRange,
    Distance,
    Encloses,
    Intersects,
    Logic,
    LogicOp,
    Norm,
    PointIn,
    Range,
    RectangleAt,
    VectorOf,
    VectorSum,
)
from scenicq.forest.scenario import Requirement
from scenicq.forest.walk import leaves as leaves_of
from scenicq.geometry.regions import Disc, PolygonSet, Rectangle
from scenicq.limits import LIMITS
from scenicq.match.decide.solver_step import ask
from scenicq.match.fields.branch_and_prune import branch_and_prune
from scenicq.match.options import MatchOptions
from scenicq.match.problem.evaluation import replay
from scenicq.match.problem.outcome import Refuted, Satisfied, Undecided
from scenicq.match.tolerance import SLACK, Tolerance
from scenicq.smt.command import SmtlibSolver

CLOSE = Tolerance(position=0.01, heading=0.01, other=0.01)


def number(value):
    return build.constant(float(value))


def between(low, high):
    return Range(number(low), number(high))


def compare(which, left, right):
    return Compare(CompareOp(which), left, number(right) if isinstance(right, int | float) else right)


def op(which, *args):
    return Arithmetic(ArithmeticOp(which), args)


def required(*conditions):
    return [(Condition(Requirement(each, None), each), each, None) for each in conditions]


A, B = between(-10, 10), between(-10, 10)
PLACE = VectorOf(A, B)
SPOT = PointIn(Constant(Rectangle((0.0, 0.0), 0.0, 20.0, 20.0)))
CIRCLE = compare("==", op("+", op("**", A, number(2)), op("**", B, number(2))), 4)
HOUSE = Constant(Rectangle((40.0, 0.0), 0.3, 4.0, 6.0))
BOX = RectangleAt(SPOT, A, number(2), number(4))

NEVER = {
    "a circle far from a line": required(CIRCLE, compare("==", op("+", A, B), 3.5)),
    "no square": required(compare("<=", op("**", A, number(2)), -1)),
    "a length": required(compare(">", Norm(PLACE), 15)),
    "a bearing behind": required(compare(">", Bearing(PLACE), 2), compare(">", B, 1)),
    "a bearing to a far side": required(compare("<", Bearing(VectorSum(PLACE, Constant((30.0, 0.0)))), -2.6)),
    "a sine": required(compare(">", op("sin", A), op("+", op("cos", B), number(2.001)))),
    "either": required(Logic(LogicOp.OR, (compare(">", A, 8), compare("<", A, -8))), compare("<", op("abs", A), 7.9)),
    "neither": required(Logic(LogicOp.NOT, (Logic(LogicOp.OR, (compare("<", A, 1), compare(">", A, 0.9))),))),
    "a whole number": required(compare("==", op("*", DiscreteRange(number(0), number(5)), number(2)), 3)),
    "in no region": required(Contains(Constant(Disc((15.0, 15.0), 3.0)), SPOT)),
    "in no disc around": required(Contains(DiscAt(PLACE, number(3)), Constant((20.0, 0.0)))),
    "near no region": required(compare("<", Distance(Constant(Disc((20.0, 0.0), 1.0)), SPOT), 8)),
    "off no region": required(compare(">", Distance(Constant(Disc((0.0, 0.0), 5.0)), SPOT), 10)),
    "meets no house": required(Intersects(BOX, HOUSE)),
    "meets no disc": required(Intersects(DiscAt(Constant((40.0, 0.0)), number(5)), BOX)),
    "lies in no house": required(Encloses(HOUSE, BOX)),
}
SOMETIMES = {
    "a length": required(compare(">", Norm(PLACE), 14), compare("<", Norm(PLACE), 14.1)),
    "a bearing": required(compare(">", Bearing(PLACE), 2), compare("<", Norm(PLACE), 1)),
    "either": required(Logic(LogicOp.OR, (compare(">", A, 8), compare("<", A, -8))), compare("<", A, 7)),
    "in a region": required(Contains(Constant(Disc((9.0, 9.0), 3.0)), SPOT), compare("<", Bearing(SPOT), -1)),
    "near a region": required(compare("<", Distance(Constant(Disc((20.0, 0.0), 1.0)), SPOT), 10)),
    "meets a disc": required(Intersects(DiscAt(Constant((14.0, 0.0)), number(5)), BOX)),
    "lies in a house": required(Encloses(Constant(Rectangle((9.0, 0.0), 0.3, 4.0, 6.0)), BOX)),
}


def test_a_point_in_a_hole_is_not_in_the_region_around_it():
    outer, hole = [(-9, -9), (9, -9), (9, 9), (-9, 9)], [(-5, -5), (5, -5), (5, 5), (-5, 5)]
    ring = Constant(PolygonSet((shapely.Polygon(outer, [hole]),), "a ring"))
    inner = compare("<", Norm(SPOT), 3)
    assert isinstance(branch_and_prune(required(Contains(ring, SPOT), inner), CLOSE), Refuted)


@pytest.mark.parametrize("name", NEVER)
def test_what_has_no_solution_is_refuted(name):
    found = branch_and_prune(NEVER[name], CLOSE)
    assert isinstance(found, Refuted), found
    assert found.constraint is NEVER[name][0][0]


@pytest.mark.parametrize("name", SOMETIMES)
def test_what_has_a_solution_has_a_witness(name):
    found = branch_and_prune(SOMETIMES[name], CLOSE)
    assert isinstance(found, Satisfied), found
    assert replay(SOMETIMES[name], found.values, CLOSE, SLACK)


def test_an_equation_that_floating_point_does_not_meet_is_left_undecided():
    found = branch_and_prune(required(CIRCLE, compare("==", A, B)), CLOSE)
    assert isinstance(found, Undecided)
    assert "divided" in found.detail


def test_what_a_label_observes_is_met():
    heading = Bearing(VectorSum(PLACE, Constant((0.0, 20.0))))
    seen = [(Comparison(0, "heading", heading, None), heading, 0.3 + math.tau)]
    found = branch_and_prune([*seen, *required(compare(">", B, 9))], CLOSE)
    assert isinstance(found, Satisfied)
    assert isinstance(branch_and_prune([*seen, *required(compare(">", A, -2))], CLOSE), Refuted)


@pytest.mark.parametrize("limit", ["pruned_boxes", "narrowing_passes", "heading_passes", "witness_replays"])
@pytest.mark.one_in(2)
def test_a_limit_leaves_it_undecided(limit, monkeypatch):
    monkeypatch.setattr(LIMITS, limit, 0)
    for name, items in NEVER.items():
        found = branch_and_prune(items, CLOSE)
        assert isinstance(found, Refuted) or (isinstance(found, Undecided) and found.reason), name
    for name, items in SOMETIMES.items():
        found = branch_and_prune(items, CLOSE)
        assert isinstance(found, Satisfied) or (isinstance(found, Undecided) and found.reason), name


def test_ranges_may_be_as_wide_as_numbers_are():
    wide = between(-1.7e308, 1.7e308)
    assert isinstance(branch_and_prune(required(compare(">", op("abs", wide), 1.75e308)), CLOSE), Refuted)


def test_z3_contradicts_nothing():
    z3 = Path(sys.executable).with_name("z3")
    if not z3.exists():
        pytest.skip("no z3 command: the package z3-solver brings one")
    options, kinds = MatchOptions(timeout_s=1.0), set()
    with SmtlibSolver(f"'{z3}' -in pp.decimal=true") as solver:
        for seed in range(40):
            rng = random.Random(seed)
            leaves = [between(*sorted((rng.uniform(-9, 9), rng.uniform(-9, 9)))) for _ in range(3)]
            roots = [random_expression(rng, leaves, RATIONAL) for _ in range(2)]
            bounds = [compare(rng.choice(("<=", ">=")), root, rng.uniform(-20, 20)) for root in roots]
            items = required(*(each for each in bounds if leaves_of(each)))
            if items:
                pair = type(branch_and_prune(items, CLOSE)), type(ask([items], options, solver))
                assert pair not in ((Satisfied, Refuted), (Refuted, Satisfied)), seed
                kinds.add(pair)
    assert {(Satisfied, Satisfied), (Refuted, Refuted)} <= kinds


@pytest.mark.parametrize("seed", range(60))
@pytest.mark.one_in(3)
def test_what_holds_somewhere_is_not_refuted(seed):
    rng = random.Random(seed)
    leaves = [between(*sorted((rng.uniform(-9, 9), rng.uniform(-9, 9)))) for _ in range(3)]
    somewhere = {leaf.identity: rng.uniform(leaf.low.value, leaf.high.value) for leaf in leaves}
    conditions = []
    for _ in range(3):
        root = random_expression(rng, leaves)
        value = evaluate(root, somewhere)
        if isinstance(value, float):
            margin = rng.choice((1e-9, 0.01, 1.0))
            conditions += [compare("<=", root, value + margin), compare(">=", root, value - margin)]
    if conditions:
        found = branch_and_prune(required(*conditions), CLOSE)
        assert not isinstance(found, Refuted)
