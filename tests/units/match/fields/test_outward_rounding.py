"""Enclosures are rounded outwards: no exact value of a random expression is outside of its bounds, up or down.

`python tests/units/match/fields/test_outward_rounding.py --cases 1000000 --seed 1` tries more of them.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from exact_values import LARGEST, Exact, exact_values, parts_of
from random_expressions import random_expression, random_number

from scenicq.forest import build
from scenicq.forest.groups import Condition
from scenicq.forest.nodes import Compare, CompareOp, Node, Normal
from scenicq.forest.scenario import Requirement
from scenicq.match.fields import interval_domain
from scenicq.match.fields.constraint_network import ConstraintNetwork
from scenicq.match.fields.contractor import BoxSet
from scenicq.match.tolerance import Tolerance

WIDTH = 32
"""Boxes of one expression that are narrowed together."""
HUGE = 1e9
"""Numbers of this size are apart by more than any slack of a comparison."""


def _box(rng: random.Random, value: float) -> tuple[float, float]:
    """An interval that a number lies in, often at an end or all of it."""
    width = rng.choice((0.0, 0.0, 1e-12, 1e-3, 1.0, 20.0)) * max(1.0, abs(value))
    low, high = value - width * rng.choice((0.0, rng.random())), value + width * rng.choice((0.0, rng.random()))
    return min(low, value), max(high, value)


def _outside(low: float, high: float, value: Exact) -> bool:
    """Whether a value between two fractions is surely not between two ends."""
    below = math.isfinite(low) and Fraction(low) > value[1]
    return below or (math.isfinite(high) and Fraction(high) < value[0])


def attempt(seed: int) -> int:
    """Try one expression over many boxes: how many had a value; none of these may be lost.

    Raises:
        AssertionError: One was.
    """
    rng = random.Random(seed)
    leaves: list[Node] = [Normal(build.constant(0.0), build.constant(1.0)) for _ in range(3)]
    target = Normal(build.constant(0.0), build.constant(1.0))
    root = random_expression(rng, leaves)
    condition = Compare(CompareOp.EQ, root, target)
    size = rng.choice((3.0, 100.0, HUGE))
    points = [[random_number(rng, size) for _ in leaves] for _ in range(WIDTH)]
    tried, values, boxes = [], [], []
    for numbers in points:
        given = {leaf.identity: (Fraction(each),) * 2 for leaf, each in zip(leaves, numbers, strict=True)}
        known = exact_values(root, given)
        if id(root) not in known or max(map(abs, known[id(root)])) > LARGEST:
            continue
        nearest = float(known[id(root)][0])
        tried.append(given)
        values.append(known)
        ends = sorted((math.nextafter(nearest, -math.inf), math.nextafter(nearest, math.inf)))
        boxes.append([*(_box(rng, each) for each in numbers), (ends[0], ends[1])])
    if not boxes:
        return 0
    ranges = {leaf.identity: [box[at] for box in boxes] for at, leaf in enumerate([*leaves, target])}
    network = ConstraintNetwork([(Condition(Requirement(condition, None), condition), condition, None)], Tolerance())
    start = BoxSet.start(network, ranges)
    left = start.narrowed()
    assert left.size == len(boxes), (seed, "a case is lost")
    for number, (given, known) in enumerate(zip(tried, values, strict=True)):
        for leaf in leaves:
            if leaf.identity in left.ranges:
                ends = left.ranges[leaf.identity][:, number].tolist()
                assert not _outside(*ends, given[leaf.identity]), (seed, number, "a random number")
        for node in network.nodes:
            value = known.get(id(node))
            if value is None:
                continue
            bounds = np.broadcast_to(left.value(node), (*left.value(node).shape[:-1], left.size))[..., number]
            for ends, part in zip(bounds.reshape(-1, 2).tolist(), parts_of(value), strict=True):
                assert not _outside(*ends, part), (seed, number, node)
    return len(boxes)


def attempt_many(seed: int, cases: int) -> int:
    """Try expressions until there were so many boxes with a value; how many there were."""
    done = 0
    while done < cases:
        done += attempt(seed)
        seed += 1
    return done


@pytest.mark.parametrize("seed", range(150))
@pytest.mark.one_in(3)
def test_no_exact_value_is_lost(seed: int) -> None:
    attempt(seed)


def test_most_expressions_have_values() -> None:
    assert sum(attempt(seed) for seed in range(1000, 1020)) > 8 * WIDTH


@pytest.mark.parametrize("part", ["step_out", "loosen", "stretch"])
def test_bounds_that_are_not_rounded_outwards_are_noticed(part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interval_domain, part, lambda bounds: bounds)
    with pytest.raises(AssertionError):
        attempt_many(2000, 9000)


def main() -> None:
    """Try as many cases as are asked for."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    print(f"{attempt_many(asked.seed * 10**9, asked.cases)} cases, none lost")


if __name__ == "__main__":
    main()
