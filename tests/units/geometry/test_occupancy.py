"""What lies at many points, against the definition over boxes whose distances are plain arithmetic."""

from __future__ import annotations

import math
import random

import numpy as np
from shapely.geometry import box

from scenicq.geometry.occupancy import _KEPT, TOLERANCE, Occupancy
from scenicq.geometry.regions import SLACK

NOTHING = 99


def off(point, sides):
    (x, y), (west, south, east, north) = point, sides
    return math.hypot(max(west - x, x - east, 0.0), max(south - y, y - north, 0.0))


def found_at(layers, point):
    """The first layer with an area at the point, else the first with one within the tolerance; an owner once."""
    for reach in (SLACK, TOLERANCE + SLACK):
        for layer in layers:
            owners = {}
            for sides, number, owner in layer:
                if off(point, sides) <= reach:
                    owners.setdefault(owner, number)
            found = tuple(owners[owner] for owner in sorted(owners))
            if any(number != NOTHING for number in found):
                return found
    return (NOTHING,)


def drawn_layer(rng, first):
    """Boxes on a grid, so that they touch, overlap and share owners; a number may stand for nothing."""
    layer = []
    for number in range(rng.randint(1, 12)):
        west, south = rng.randint(0, 8), rng.randint(0, 8)
        sides = (west, south, west + rng.randint(1, 4), south + rng.randint(1, 4))
        layer.append((sides, rng.choice([first + number, first, NOTHING]), rng.randint(0, 6)))
    return layer


def drawn_point(rng):
    """Anywhere, on the grid, or close to it, clear of the tolerance by more than rounding."""
    steps = [0.0, 0.02, TOLERANCE - 1e-3, TOLERANCE + 1e-3]
    return tuple(
        rng.uniform(-1, 13) if rng.random() < 0.3 else rng.randint(0, 12) + rng.choice((-1, 1)) * rng.choice(steps)
        for _ in range(2)
    )


def test_points_one_by_one_and_together():
    rng = random.Random(5)
    for _ in range(30):
        layers = [drawn_layer(rng, 10 * number) for number in range(rng.randint(1, 3))]
        areas = tuple(tuple((box(*sides), number, owner) for sides, number, owner in layer) for layer in layers)
        points = [drawn_point(rng) for _ in range(60)]
        expected = [found_at(layers, point) for point in points]
        assert Occupancy(areas, NOTHING, "boxes").at_many(np.array(points)) == expected
        assert [Occupancy(areas, NOTHING, "boxes").at(*point) for point in points[:5]] == expected[:5]


def test_more_points_than_are_kept():
    """What is known of some of them is let go while the others are looked up."""
    rng = random.Random(6)
    layers = [drawn_layer(rng, 0), drawn_layer(rng, 50)]
    areas = tuple(tuple((box(*sides), number, owner) for sides, number, owner in layer) for layer in layers)
    options = Occupancy(areas, NOTHING, "boxes")
    points = [(n % 131 / 10, n / 400) for n in range(_KEPT + 500)]
    for some in (points[:300], points, points[200:400]):
        assert options.at_many(np.array(some)) == [found_at(layers, point) for point in some]
