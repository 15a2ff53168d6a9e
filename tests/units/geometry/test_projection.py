"""The nearest points of discs, and of what is made of them, to many places are those to each of them."""

import math
import random

import numpy as np
import pytest

from scenicq.geometry.membership import contains, nearest_point
from scenicq.geometry.projection import nearest_points
from scenicq.geometry.regions import DifferenceOf, Disc, Rectangle, UnionOf

EVERYWHERE = (-math.inf, -math.inf, math.inf, math.inf)


def random_region(chance):
    discs = [
        Disc((chance.randint(-5, 5), chance.randint(-5, 5)), chance.choice([-1, 0, 0.5, 2, 7, 1e5])) for _ in range(3)
    ]
    beside = Rectangle((2, 3), chance.uniform(-3, 3), 3, chance.choice([1, 4]))
    return chance.choice([discs[0], UnionOf(tuple(discs)), UnionOf((discs[0], beside)), DifferenceOf(beside, discs[1])])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("count", [1, 40])
@pytest.mark.one_in(4)
def test_nearest_points_are_those_of_each_place(seed, count):
    chance = random.Random(f"{seed} {count}")
    for _ in range(40):
        region = random_region(chance)
        xy = np.array([(chance.uniform(-9, 9), chance.uniform(-9, 9)) for _ in range(count)])
        xy[0] = np.round(xy[0])  # the middle of a disc, now and then
        for place, found in zip(xy.tolist(), nearest_points(region, xy, EVERYWHERE).tolist(), strict=True):
            right = nearest_point(region, *place)
            if right is None:
                assert np.isnan(found).all()
            else:
                assert math.dist(place, found) == pytest.approx(math.dist(place, right), abs=1e-6)
                assert contains(region, *found)
