"""Draw the distances in a scenario's requirements, as lines with their metres."""

# shapely has no type annotations.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import cast

import shapely

from scenicq.errors import CannotEvaluate
from scenicq.forest.condition import condition
from scenicq.forest.evaluate import Observation
from scenicq.forest.nodes import Constant, Distance, Node, Norm, Scale, VectorSum
from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import postorder
from scenicq.geometry import shapes
from scenicq.geometry.outlines import outline
from scenicq.geometry.regions import Region
from scenicq.geometry.shapes import XY, Bounds
from scenicq.report.placement import Placement
from scenicq.report.svg import Plane, element

__all__ = ["Measured", "draw_distances", "measured_distances"]

Measured = tuple[XY, XY]
"""Both ends of a distance, in metres."""

_ASIDE = 130
"""Centimetres from a line to its length: more than half the width of a car."""
_PARTS = (1 / 2, 1 / 3, 2 / 3, 1 / 5, 4 / 5)
"""Where along a line its length may stand, the best first."""
_LETTER = 0.6
"""Width of a letter by its height."""
_LENGTH = 5.0
"""How bad it is to hide a length."""


def measured_distances(scenario: Scenario, observed: Observation, bounds: Bounds) -> list[Measured]:
    """Measure the distances in the program's requirements, as far as both ends are known.

    Args:
        scenario: The scenario.
        observed: Values of features.
        bounds: What is drawn, in metres; regions are measured to as far as they lie there.
    """
    found: dict[Measured, None] = {}
    for requirement in scenario.requirements:
        if requirement.built_in is not None:
            continue
        for node in postorder((requirement.condition,)):
            for ends in _ends(node, observed, bounds):
                if ends not in found and ends[::-1] not in found:
                    found[ends] = None
    return list(found)


def _ends(node: Node, observed: Observation, bounds: Bounds) -> Iterator[Measured]:
    match node:
        case Norm(vector=VectorSum(left=left, right=Scale(vector=right, factor=Constant(value=-1.0)))):
            one, other = _known(left, observed), _known(right, observed)
            if isinstance(one, tuple) and isinstance(other, tuple):
                yield cast(XY, other), cast(XY, one)
        case Distance(region=region, point=point):
            place, known = _known(point, observed), _known(region, observed)
            if not isinstance(place, tuple) or not isinstance(known, Region):
                return
            pieces = outline(known, bounds)
            if pieces:
                line = shapely.shortest_line(shapely.points(*place), shapes.union_all(pieces))
                start, end = shapely.get_coordinates(line).tolist()
                yield (start[0], start[1]), (end[0], end[1])
        case _:
            pass


def _known(node: Node, observed: Observation) -> object:
    try:
        found = condition(node, observed)
    except CannotEvaluate:
        return None
    return found.value if isinstance(found, Constant) else None


def draw_distances(found: list[Measured], plane: Plane, placement: Placement, size: int) -> str:
    """Draw a line for each, with its length beside its middle, or where there is room.

    Args:
        found: As `measured_distances` gives them.
        plane: Where the picture lies.
        placement: What is drawn already; the lengths become part of it.
        size: Height of the letters in centimetres.
    """
    parts: list[str] = []
    for (x0, y0), (x1, y1) in found:
        metres = math.hypot(x1 - x0, y1 - y0)
        if 100 * metres < size:
            continue  # the ends are one spot in the picture
        (left, top), (right, bottom) = plane.at(x0, y0), plane.at(x1, y1)
        parts.append(element("path", class_="distance", d=f"M{left} {top}L{right} {bottom}"))
        # beside the line, where no box at one of its ends hides it
        upright = abs(bottom - top) > abs(right - left)
        told = f"{metres:.1f} m"
        wide, high = size * _LETTER * len(told) / 2, size / 2
        aside, above = (_ASIDE + wide, -round(size * 0.35)) if upright else (0, _ASIDE)
        spots = [(left + part * (right - left) - aside, top + part * (bottom - top) - above) for part in _PARTS]
        x, y = placement.place(spots, wide, high, _LENGTH)
        parts.append(
            element(
                "text",
                told,
                class_="metres",
                x=round(x + wide if upright else x),
                y=round(y),
                font_size=size,
                text_anchor="end" if upright else "middle",
            )
        )
    return "".join(parts)
