"""What bounds of hidden numbers and points tell of conditions over time, against plain values within these bounds."""

from __future__ import annotations

import random
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[1] / "forest"))
from expressions import expressions

from scenicq.forest import build
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import (
    Compare,
    CompareOp,
    Coordinate,
    DirectionAt,
    Feature,
    Logic,
    LogicOp,
    Norm,
    PointIn,
    Range,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import transform
from scenicq.geometry.default_street import street
from scenicq.geometry.regions import Rectangle
from scenicq.temporal.atoms import AtomColumns
from scenicq.temporal.enclosures import certainly, unchanging
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN

SAMPLES = 6


class Seen:
    """Random observations of whatever is asked, some of which are missing."""

    def __init__(self, kinds: dict[int, str], seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.columns = {}
        for number, kind in kinds.items():
            values = rng.uniform(-9, 9, (2 if kind == "vector" else 1, SAMPLES))
            values[:, rng.random(SAMPLES) < 0.15] = np.nan
            self.columns[number] = tuple(values)

    def __len__(self) -> int:
        return SAMPLES

    def observed(self, index: int, _: str):
        return self.columns[index]


def changing(root, seed: int):
    """The expression with observations in place of about half of its random numbers and points, and their kinds."""
    draw = random.Random(seed)
    features: dict[object, Feature] = {}
    kept = set()

    def step(node):
        if not isinstance(node, Range | PointIn) or node.identity in kept:
            return node
        if node.identity not in features and draw.random() < 0.5:
            kept.add(node.identity)
            return node
        kind = "vector" if isinstance(node, PointIn) else "scalar"
        return features.setdefault(node.identity, Feature(len(features), "seen", kind, current=True))

    found = transform(root, step)
    return found, {feature.object: feature.kind for feature in features.values()}


def value_of(columns: AtomColumns, node) -> float:
    found = columns.number(node)
    return np.nan if found is None else float(found[0])


decided = {FALSE: 0, TRUE: 0, UNKNOWN: 0}


@given(expressions(), expressions(), st.integers(0, 10**6))
@settings(max_examples=250, deadline=None, derandomize=True, phases=[Phase.generate])
def check(case, other, seed):
    draw = random.Random(seed)
    parts = []
    for root, _ in (case, other):
        numbers = [Norm(root), Coordinate(root, 0), Coordinate(root, 1)]
        op = draw.choice([CompareOp.LT, CompareOp.LE, CompareOp.GT, CompareOp.GE])
        parts.append(Compare(op, draw.choice(numbers), build.constant(draw.uniform(-20, 20))))
    if draw.random() < 0.5:
        parts[0] = Logic(LogicOp.NOT, (parts[0],))
    root = Logic(draw.choice([LogicOp.AND, LogicOp.OR]), tuple(parts))
    condition, kinds = changing(root, seed)
    values = {**case[1], **other[1]}
    columns = AtomColumns(None, Seen(kinds, seed))
    exact = columns.assigned(values)
    bounds = {}
    for node in unchanging([condition]):
        numbers = [Coordinate(node, axis) for axis in (0, 1)] if kind_of(node) == "vector" else [node]
        ends = [value_of(exact, each) for each in numbers]
        # what has no value is within any bounds
        ends = [draw.uniform(-9, 9) if np.isnan(end) else end for end in ends]
        if draw.random() < 0.8:
            bounds[id(node)] = [
                (end - draw.choice([0.0, 0.1, 1.0]), end + draw.choice([0.0, 0.1, 1.0])) for end in ends
            ]
    found, truth = certainly(columns, condition, bounds), exact.truth_of(condition)
    known = (found != UNKNOWN) & (truth != UNKNOWN)
    assert (found[known] == truth[known]).all()
    for value in found.tolist():
        decided[value] += 1


@pytest.mark.slow
def test_what_bounds_tell_is_so_for_values_within():
    check()
    assert min(decided.values()) > 40


SPOT = PointIn(build.constant(Rectangle((0.0, 0.0), 0.0, 100.0, 100.0)))
EGO = Feature(0, "position", "vector", current=True)
AWAY = Norm(VectorSum(EGO, build.scale(SPOT, build.constant(-1.0))))


class Drive(Seen):
    """One object goes along the x axis, a metre a sample."""

    def __init__(self) -> None:
        self.columns = {0: (np.arange(SAMPLES, dtype=float), np.zeros(SAMPLES))}


def test_a_point_in_a_small_box_leaves_the_samples_near_a_threshold_open():
    condition = Compare(CompareOp.GT, AWAY, build.constant(2.5))
    (point,) = unchanging([condition])
    columns = AtomColumns(None, Drive())
    box = {id(point): [(-0.6, 0.6), (-0.1, 0.1)]}
    assert certainly(columns, condition, box).tolist() == [FALSE, FALSE, UNKNOWN, UNKNOWN, TRUE, TRUE]


@pytest.mark.parametrize("negated", [False, True])
def test_what_may_be_without_a_value_is_never_certain_to_hold(negated):
    field = build.constant(street().roadDirection)
    direction = DirectionAt(field, VectorOf(Coordinate(SPOT, 0), Coordinate(EGO, 1)))
    condition = Compare(CompareOp.GT if negated else CompareOp.LT, direction, build.constant(9.0))
    if negated:
        condition = Logic(LogicOp.NOT, (condition,))
    assert certainly(AtomColumns(None, Drive()), condition, {}).tolist() == [UNKNOWN] * SAMPLES
    never = Compare(CompareOp.GT, direction, build.constant(9.0))
    assert certainly(AtomColumns(None, Drive()), never, {}).tolist() == [FALSE] * SAMPLES
