"""Points that stand for all points of the plane: circles and lines cut it into pieces, of which each has one.

A condition that changes on the curves alone has one value in each piece.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

Points = npt.NDArray[np.float64]
"""Of shape (n, 2)."""
Circle = tuple[float, float, float]
"""Centre and radius."""
STEP = 1e-5
_FAR = 3.0


def representatives(circles: Iterable[Circle], across: Iterable[float] = (), ahead: Iterable[float] = ()) -> Points:
    """One point of each face, edge and vertex; pieces that are thinner than `STEP` may have none.

    Args:
        circles: The circles.
        across: The x of lines along y.
        ahead: The y of lines along x.
    """
    rings, columns, rows = sorted(set(circles)), sorted(set(across)), sorted(set(ahead))
    ends = [each + side * radius for x, y, radius in rings for each in (x, y) for side in (-1, 1)] + columns + rows
    low, high = min(ends, default=0.0) - _FAR, max(ends, default=0.0) + _FAR
    found: list[Sequence[float] | Points] = [[(low + high) / 2, low], *([x, y] for x in columns for y in rows)]
    for number, ring in enumerate(rings):
        turns = [turn for other in rings[:number] + rings[number + 1 :] for turn in _crossings(ring, other)]
        for side, cuts in ((0, columns), (1, rows)):
            for cut in cuts:
                away = (cut - ring[side]) / ring[2]
                if abs(away) <= 1:
                    turn = math.acos(away) if side == 0 else math.asin(away)
                    turns += [turn, -turn if side == 0 else math.pi - turn]
        found.append(_around(ring, turns))
    for side, cuts, others in ((0, columns, rows), (1, rows, columns)):
        for cut in cuts:
            stops = [low, high, *others]
            for ring in rings:
                if (reach := ring[2] ** 2 - (cut - ring[side]) ** 2) >= 0:
                    stops += [ring[1 - side] - math.sqrt(reach), ring[1 - side] + math.sqrt(reach)]
            stops = sorted({round(each, 9) for each in stops})
            middle = np.array([*stops, *((a + b) / 2 for a, b in itertools.pairwise(stops))])
            for away in (-STEP, 0.0, STEP):
                line = np.full_like(middle, cut + away)
                found.append(np.column_stack((line, middle) if side == 0 else (middle, line)))
    return np.vstack([np.reshape(np.asarray(each, np.float64), (-1, 2)) for each in found])


def _crossings(one: Circle, other: Circle) -> list[float]:
    """The directions from the centre of a circle to where another crosses it."""
    x, y = other[0] - one[0], other[1] - one[1]
    apart = math.hypot(x, y)
    if apart == 0:
        return []
    away = (apart * apart + one[2] ** 2 - other[2] ** 2) / (2 * apart * one[2])
    if abs(away) > 1:
        return []
    return [math.atan2(y, x) + math.acos(away), math.atan2(y, x) - math.acos(away)]


def _around(ring: Circle, turns: list[float]) -> Points:
    """The crossings on a circle, the middles between them, and what lies beside these."""
    stops = sorted({round(turn % math.tau, 9) for turn in turns}) or [0.0]
    middles = [(a + b) / 2 for a, b in zip(stops, [*stops[1:], stops[0] + math.tau], strict=True)]
    angles = np.array([*stops, *middles])
    points = [
        np.column_stack((ring[0] + radius * np.cos(angles), ring[1] + radius * np.sin(angles)))
        for radius in (ring[2] - STEP, ring[2], ring[2] + STEP)
    ]
    return np.vstack(points)
