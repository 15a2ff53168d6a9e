"""Replaying a witness: one use of a field has one direction, every combination of directions counts, up to a limit."""

from __future__ import annotations

import itertools
import math
import random

import pytest
from comparisons import DEFAULT, c, compared

from scenicq.forest.nodes import Constant, DirectionAt, Rotate, VectorSum
from scenicq.limits import LIMITS
from scenicq.match.problem.evaluation import replay


class Fan:
    """Two directions on the left of the y axis, three on the right; others at every place."""

    name = "fan"

    def values(self, x, y):
        count = 2 if x < 0 else 3
        return tuple(math.remainder(0.3 * x + 0.1 * y + 2.0 * number, math.tau) for number in range(count))


FAN = Fan()


def use(point):
    return DirectionAt(Constant(FAN, span=None), point, span=None)


def moved(point, turn, by=1.0):
    return VectorSum(point, Rotate(c((0.0, by)), turn, span=None), span=None)


def step(point, turn, by=1.0):
    return point[0] - by * math.sin(turn), point[1] + by * math.cos(turn)


def test_all_directions_of_a_chain_count_and_no_others():
    # the second step has two or three directions, depending on the first
    rng, start = random.Random(2), (0.3, 0.4)
    first = moved(c(start), use(c(start)))
    last = moved(first, use(first))
    ends = [step(place, turn) for place in (step(start, a) for a in FAN.values(*start)) for turn in FAN.values(*place)]
    assert 6 < len(ends) < 9
    for end in ends:
        assert replay([compared("position", last, end)], {}, DEFAULT, 0.0)
    for end in ends:
        away = step(end, rng.uniform(-3, 3), 0.05)
        near = any(math.dist(away, other) <= DEFAULT.position for other in ends)
        assert replay([compared("position", last, away)], {}, DEFAULT, 0.0) is near


def test_one_use_has_one_direction_in_all_constraints_and_two_uses_have_their_own():
    start = (0.3, 0.4)
    for seen, gone in itertools.product(FAN.values(*start), repeat=2):
        end = step(start, gone)
        one = use(c(start))
        shared = [compared("heading", one, seen), compared("position", moved(c(start), one), end)]
        apart = [compared("heading", use(c(start)), seen), compared("position", moved(c(start), use(c(start))), end)]
        assert replay(shared, {}, DEFAULT, 0.0) is (seen == gone)
        assert replay(apart, {}, DEFAULT, 0.0)


@pytest.mark.parametrize(("uses", "found"), [(10, True), (11, False)])
@pytest.mark.one_in(2)
def test_combinations_are_tried_up_to_a_limit_of_one_part(uses, found):
    # steps of different lengths from the left: only the last of all combinations leads to the end
    start = (-9.0, 0.0)
    turns = FAN.values(*start)
    assert len(turns) ** 10 == LIMITS.replayed_directions
    steps = [Rotate(c((0.0, 2.0**-number)), use(c(start)), span=None) for number in range(uses)]
    total, end = c((0.0, 0.0)), (0.0, 0.0)
    for number, each in enumerate(steps):
        total = VectorSum(total, each, span=None)
        end = step(end, turns[-1], 2.0**-number)
    assert replay([compared("position", total, end)], {}, DEFAULT, 0.0) is found
    single = [compared("position", each, step((0.0, 0.0), turns[-1], 2.0**-k)) for k, each in enumerate(steps)]
    assert replay(single, {}, DEFAULT, 0.0)
