"""The formula of a field's direction against the field itself, on both sides of curved borders."""

from __future__ import annotations

import math

import numpy as np
import pytest
from formulas import Var, evaluate
from shapely import Polygon, box

from scenicq.geometry.angles import distance
from scenicq.geometry.road_direction import DirectedLane, RoadDirection
from scenicq.smt.field import field_cells

WIDE = 14.0


def bend(area: Polygon, *corners: tuple[float, float]) -> DirectedLane:
    return DirectedLane(area, (np.array(corners, dtype=float),))


# The borders between the legs of a hairpin, which do not touch, are parabolas.
HAIRPIN = bend(box(-9, -6, 9, 9), (-3, -6), (-3, 5), (2, 6), (4, -6))
FIELDS = {
    "hairpin": RoadDirection((HAIRPIN,)),
    "two lanes that overlap": RoadDirection((HAIRPIN, bend(box(-2, -12, 12, 3), (12, -2), (-2, -1), (-2, -12)))),
    "beside lanes": RoadDirection(
        (bend(box(-9, -6, -5, 6), (-7, -6), (-7, 6)), bend(box(3, -9, 7, 2), (5, 2), (4, -9)))
    ),
}


@pytest.mark.slow
def test_the_formula_allows_what_the_field_allows() -> None:
    rng = np.random.default_rng(5)
    for name, field in FIELDS.items():
        limits = (-WIDE, -WIDE, WIDE, WIDE)
        cells = field_cells(field, (Var("x"), Var("y")), limits)
        guarded = [cell for cell in field.cells(limits) if cell.guards]
        curved = 0
        for x, y in rng.uniform(-WIDE, WIDE, (25, 2)).tolist():
            around = field.values_many(np.array([(x, y), (x + 1e-4, y), (x, y + 1e-4), (x - 1e-4, y), (x, y - 1e-4)]))
            if any(each != around[0] for each in around):
                continue
            said = {heading for heading, where in cells if evaluate(where, {"x": x, "y": y})}
            assert all(any(distance(a, b) < 1e-9 for b in around[0]) for a in said), (name, x, y)
            assert all(any(distance(a, b) < 1e-9 for b in said) for a in around[0]), (name, x, y)
            holding = {cell.heading for cell in guarded if _holds(cell.polygon, x, y)}
            curved += bool(holding - said)
        assert curved, f"{name}: no sampled point lies on the wrong side of a guarded cell"


def _holds(polygon: np.ndarray, x: float, y: float) -> bool:
    along, off = np.roll(polygon, -1, axis=0) - polygon, (x, y) - polygon
    return bool((along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0] >= 0).all())


def test_near_a_border_both_sides_are_there() -> None:
    field = FIELDS["hairpin"]
    xs = np.linspace(-9, 9, 401)
    headings = field.values_many(np.column_stack([xs, np.full_like(xs, 1.0)]))
    borders = [(a + b) / 2 for a, b, one, two in zip(xs, xs[1:], headings, headings[1:], strict=False) if one != two]
    assert borders
    for x in borders:
        near = field_cells(field, (Var("x"), Var("y")), (x - 0.02, 0.98, x + 0.02, 1.02))
        wanted = {value for dx in (-0.015, 0.015) for value in field.values(x + dx, 1.0)}
        assert len(wanted) == 2
        assert wanted <= {heading for heading, _ in near}
        # well away from the border, the other side is not even encoded
        for dx in (-0.5, 0.5):
            alone = field_cells(field, (Var("x"), Var("y")), (x + dx - 0.02, 0.98, x + dx + 0.02, 1.02))
            assert {heading for heading, _ in alone} == set(field.values(x + dx, 1.0))
    assert math.isclose(field.values(-3, 1)[0], 0.0, abs_tol=1e-12)
