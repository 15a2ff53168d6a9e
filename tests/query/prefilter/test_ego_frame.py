"""Columns of the ego's frame stand for what expressions compute, and only where they compute just that."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenicq.forest.build import constant
from scenicq.forest.evaluate import evaluate
from scenicq.forest.nodes import Arithmetic, ArithmeticOp, Bearing, Feature, Node, Norm, Rotate, Scale, VectorSum
from scenicq.forest.walk import features, postorder
from scenicq.query.prefilter.ego_frame import DISTANCE, PLACE, in_ego_frame

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
