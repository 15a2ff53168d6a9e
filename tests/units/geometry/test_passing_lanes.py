"""Which areas hold each place: parts of the plane say the same as plain geometry."""

from __future__ import annotations

import random

import shapely

from scenicq.geometry.passing_lanes import areas_at, areas_everywhere

AREAS = [
    shapely.box(0, 0, 10, 4),
    shapely.box(6, -6, 10, 10),
    shapely.Point(4, 4).buffer(3),
    shapely.box(10.02, 0, 14, 4),
    shapely.difference(shapely.box(20, 0, 30, 10), shapely.box(23, 3, 27, 7)),
]


def _found(layers, x, y):
    here = shapely.Point(x, y)
    for layer in layers:
        held = [numbers for part, numbers in layer if shapely.intersects(part, here)]
        if held:
            return held
    return []


def test_parts_of_the_plane_hold_what_points_are_held_by() -> None:
    rng, layers = random.Random(3), areas_everywhere(AREAS)
    together, nowhere = shapely.union_all(AREAS), 0
    for _ in range(1500):
        x, y = rng.uniform(-10, 40), rng.uniform(-12, 16)
        expected, found = areas_at(AREAS, x, y), _found(layers, x, y)
        assert len(found) == 1
        away = shapely.distance(shapely.Point(x, y), together)
        if away <= 0.05:
            assert list(found[0]) == expected
        else:
            nowhere += 1
            second = sorted(shapely.distance(area, shapely.Point(x, y)) for area in AREAS)[1]
            assert list(found[0]) == expected or second - away < 0.2
    assert nowhere > 500
    assert areas_at([], 0, 0) == []
