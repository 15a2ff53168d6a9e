"""Columns of the ego's frame stand for what expressions compute, only where they compute just that; quick forms too."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenicq.forest.build import constant
from scenicq.forest.clear_columns import QuickColumns, quick_form
from scenicq.forest.columns import DEFINED, Column
from scenicq.forest.ego_frame import DISTANCE, PLACE, in_ego_frame
from scenicq.forest.evaluate import evaluate
from scenicq.forest.interpret import interpret, steps_of
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    CompareOp,
    Feature,
    Logic,
    LogicOp,
    Node,
    Norm,
    Rotate,
    Scale,
    VectorSum,
)
from scenicq.forest.walk import features, postorder

ADD, SUB, MUL, NEG = ArithmeticOp.ADD, ArithmeticOp.SUB, ArithmeticOp.MUL, ArithmeticOp.NEG
SIN, COS, WRAP = ArithmeticOp.SIN, ArithmeticOp.COS, ArithmeticOp.WRAP
HEADING = Feature(0, "heading", "scalar")
OTHER = Feature(1, "heading", "scalar")


def seen(index: int = 1, observer: int = 0) -> Node:
    """Where an object is, as seen from another."""
    minus = Scale(Feature(observer, "position", "vector"), constant(-1.0))
    return VectorSum(Feature(index, "position", "vector"), minus)


def op(kind: ArithmeticOp, *args: Node) -> Node:
    """An operation."""
    return Arithmetic(kind, args)


def values_at(rng: np.random.Generator) -> dict[tuple[int, str], object]:
    """Two objects somewhere, with what the store knows of the second."""
    ego, place = rng.uniform(-100, 100, 2), rng.uniform(-100, 100, 2)
    heading = float(rng.uniform(-math.pi, math.pi))
    dx, dy = (place - ego).tolist()
    right = dx * math.cos(heading) + dy * math.sin(heading)
    ahead = -dx * math.sin(heading) + dy * math.cos(heading)
    return {
        (0, "position"): (float(ego[0]), float(ego[1])), (1, "position"): (float(place[0]), float(place[1])),
        (0, "heading"): heading, (1, "heading"): float(rng.uniform(-math.pi, math.pi)),
        (1, PLACE): (right, ahead), (1, DISTANCE): math.hypot(dx, dy),
    }  # fmt: skip


TERMS = {
    "ahead": op(MUL, Norm(seen()), op(COS, op(SUB, Bearing(seen()), HEADING))),
    "left": op(MUL, op(SIN, op(SUB, Bearing(seen()), HEADING)), Norm(seen())),
    "the other way round": op(MUL, Norm(seen()), op(COS, op(SUB, HEADING, Bearing(seen())))),
    "right": op(MUL, Norm(seen()), op(SIN, op(SUB, HEADING, Bearing(seen())))),
    "wrapped": op(MUL, Norm(seen()), op(SIN, op(WRAP, op(SUB, Bearing(seen()), HEADING)))),
    "in its own frame": op(MUL, Norm(seen()), op(COS, op(ADD, op(NEG, OTHER), Bearing(seen())))),
    "north": op(MUL, Norm(seen()), op(COS, Bearing(seen()))),
    "further": op(ADD, Norm(seen()), op(MUL, constant(2.0), Norm(seen()))),
    "turned": Norm(Rotate(seen(), op(NEG, HEADING))),
}


@pytest.mark.parametrize("name", TERMS)
def test_the_columns_give_the_value(name):
    found = in_ego_frame(TERMS[name], 0)
    rng = np.random.default_rng(1)
    for _ in range(50):
        known = values_at(rng)
        before, after = (evaluate(root, {}, known) for root in (TERMS[name], found))
        assert after == pytest.approx(before, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "used"),
    [("ahead", {(1, PLACE)}), ("left", {(1, PLACE)}), ("right", {(1, PLACE)}), ("wrapped", {(1, PLACE)}),
     ("the other way round", {(1, PLACE)}), ("further", {(1, DISTANCE)}), ("turned", {(1, PLACE)}),
     ("in its own frame", {(0, "position"), (1, "position"), (1, "heading")}),
     ("north", {(0, "position"), (1, "position")})],
)  # fmt: skip
def test_what_is_read(name, used):
    found = in_ego_frame(TERMS[name], 0)
    assert set(features(found)) == used
    assert not any(isinstance(node, Bearing) for node in postorder((found,)))


UNLIKE = {
    "another's length": op(MUL, Norm(seen(2)), op(COS, op(SUB, Bearing(seen()), HEADING))),
    "another's bearing": op(MUL, Norm(seen()), op(COS, op(SUB, Bearing(seen(1, 2)), HEADING))),
    "twice the bearing": op(MUL, Norm(seen()), op(COS, op(ADD, Bearing(seen()), Bearing(seen())))),
    "a multiple": op(MUL, Norm(seen()), op(COS, op(MUL, Bearing(seen()), constant(2.0)))),
}


@pytest.mark.parametrize("name", UNLIKE)
def test_what_is_something_else_keeps_its_value(name):
    found = in_ego_frame(UNLIKE[name], 0)
    rng = np.random.default_rng(2)
    for _ in range(20):
        known = values_at(rng)
        known |= {(2, "position"): (3.0, 4.0), (2, DISTANCE): math.dist((3.0, 4.0), known[0, "position"])}
        before, after = (evaluate(root, {}, known) for root in (UNLIKE[name], found))
        assert after == pytest.approx(before, abs=1e-9)


# --- quick forms

ANGLES = {
    "to the right": op(WRAP, op(SUB, Bearing(seen()), HEADING)),
    "turned by what is seen": op(WRAP, op(SUB, OTHER, op(ADD, Bearing(seen()), constant(math.pi)))),
    "twice": op(MUL, constant(2.0), Norm(seen())),
}
COUNT = 300


def _places(rng: np.random.Generator) -> dict[tuple[int, str], tuple[np.ndarray, ...]]:
    """Two objects at places, many of which are whole numbers, with headings, many of which are parts of a turn."""
    whole = rng.random(COUNT) < 0.6
    x, y, u, v = (np.where(whole, rng.integers(-3, 4, COUNT), rng.normal(size=COUNT) * 40) for _ in range(4))
    turns = rng.integers(-4, 5, COUNT) * math.pi / 4
    heading = np.where(rng.random(COUNT) < 0.6, turns, rng.uniform(-math.pi, math.pi, COUNT))
    dx, dy = u - x, v - y
    right, ahead = dx * np.cos(heading) + dy * np.sin(heading), dy * np.cos(heading) - dx * np.sin(heading)
    return {
        (0, "position"): (x, y), (1, "position"): (u, v), (0, "heading"): (heading,), (1, "heading"): (turns[::-1],),
        (1, PLACE): (right, ahead), (1, DISTANCE): (np.hypot(dx, dy),),
    }  # fmt: skip


def _at(places: dict[tuple[int, str], tuple[np.ndarray, ...]], number: int) -> dict[tuple[int, str], object]:
    return {key: float(each[0][number]) if len(each) == 1 else tuple(float(one[number]) for one in each)
            for key, each in places.items()}  # fmt: skip


@pytest.mark.parametrize("name", [*TERMS, *ANGLES])
@pytest.mark.one_in(6)
def test_quick_forms_tell_what_plain_evaluation_tells(name):
    rng = np.random.default_rng(len(name))
    term = (TERMS | ANGLES)[name]
    places = _places(rng)
    features = [_at(places, number) for number in range(COUNT)]
    values = [evaluate(term, {}, each) for each in features]
    told = 0
    for _ in range(20):
        op_ = list(CompareOp)[int(rng.integers(6))]
        # half of the limits are met somewhere to the last bit
        limit = float(rng.choice(values)) if rng.random() < 0.5 else float(rng.normal() * 5)
        asked = Logic(LogicOp.NOT, (Compare(op_, constant(limit), term),))
        quick = quick_form(asked, 0)
        if quick is None:
            assert not any(isinstance(node, Bearing) for node in postorder((asked,)))
            return

        def observed(node: Feature) -> Column:
            data = places[node.object, node.property]
            return Column(data if len(data) == 2 else data[0], np.full(COUNT, DEFINED))

        domain = QuickColumns(observed, lambda *_: pytest.fail("random"), lambda *_: pytest.fail("a field"))
        data, status = interpret(steps_of(quick), domain)[id(quick)]
        known = np.broadcast_to(status == DEFINED, COUNT)
        for number in np.flatnonzero(known).tolist():
            assert bool(np.broadcast_to(data, COUNT)[number]) is evaluate(asked, {}, features[number])
        told += int(known.sum())
    assert told > 10 * COUNT


@pytest.mark.parametrize("factor", [1e4, math.inf])
def test_what_would_be_off_by_too_much_has_no_quick_form(factor):
    times = op(MUL, constant(factor), TERMS["ahead"]) if factor < math.inf else op(MUL, TERMS["ahead"], TERMS["left"])
    assert quick_form(Compare(CompareOp.LT, times, constant(1.0)), 0) is None
