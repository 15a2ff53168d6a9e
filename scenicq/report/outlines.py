"""What a scenario allows each of its objects in one label: where it may be and which way it may face.

An outline is exact where the position is a point of a region, or an expression that is affine in each random variable;
otherwise it is an outer bound, and says so. Features of other objects are the label's values ("condition", algorithm 1
of the query paper).
"""

# shapely has no type annotations.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import cast

import shapely

from scenicq.errors import CannotEvaluate
from scenicq.forest.bounds import FloatInterval, scalar_bounds, vector_bounds
from scenicq.forest.condition import condition
from scenicq.forest.evaluate import Observation, evaluate
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Constant,
    DiscAt,
    Identity,
    Node,
    PointIn,
    Range,
    Rotate,
    Scale,
    SectorAt,
    Value,
    VectorOf,
    VectorSum,
)
from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import children, features, postorder
from scenicq.geometry import shapes
from scenicq.geometry.outlines import clip, outline
from scenicq.geometry.regions import (
    Disc,
    Region,
    Sector,
)
from scenicq.geometry.shapes import Bounds, Shape
from scenicq.query.explain.violations import choices

__all__ = ["PossibleArea", "allowed_headings", "allowed_place", "views"]

_MOST_RANGES = 6
_THIN = 0.2
"""Metres around what has no area, so that it can be seen."""


@dataclass(frozen=True, slots=True)
class PossibleArea:
    """Where an object may be.

    Attributes:
        shapes: Outlines in metres whose union it is, cut to what is drawn.
        exact: Whether the union is what is allowed, rather than something larger.
        fixed: Whether it is the same in every frame.
    """

    shapes: tuple[Shape, ...]
    exact: bool
    fixed: bool


def _visible(pieces: list[Shape]) -> tuple[Shape, ...]:
    """The pieces, with some width for those that have none."""
    return tuple(
        piece if piece.geom_type in ("Polygon", "MultiPolygon") else cast(Shape, shapely.buffer(piece, _THIN))
        for piece in pieces
    )


def _ranges(root: Node) -> list[Range] | None:
    """The random variables of an expression, if it is affine in each; else None."""
    below: dict[int, frozenset[Identity]] = {}
    found: dict[Identity, Range] = {}
    for node in postorder((root,)):
        parts = [below[id(child)] for child in children(node)]
        match node:
            case Constant() | VectorOf() | VectorSum():
                pass
            case Range() if not any(parts):
                parts = [frozenset((node.identity,))]
                found[node.identity] = node
            case Scale() if not parts[0] & parts[1]:
                pass
            case Rotate() if not parts[1]:
                pass
            case Arithmetic(op=ArithmeticOp.ADD | ArithmeticOp.SUB | ArithmeticOp.NEG):
                pass
            case Arithmetic(op=ArithmeticOp.MUL) if not parts[0] & parts[1]:
                pass
            case _:
                return None
        below[id(node)] = frozenset[Identity]().union(*parts)
    return list(found.values())


def _reach(root: Node, bounds: Bounds) -> tuple[list[Shape], bool] | None:
    """The area that a vector expression can reach within bounds, and whether that is exact; None for anywhere."""
    if isinstance(root, PointIn) and isinstance(root.region, Constant):
        return outline(cast(Region, root.region.value), bounds), True
    ranges = _ranges(root)
    if ranges is not None and len(ranges) <= _MOST_RANGES:
        # affine in each variable: every value lies in the hull of those at the ends
        ends = [scalar_bounds(each) for each in ranges]
        corners: list[Value] = [
            evaluate(root, {each.identity: value for each, value in zip(ranges, values, strict=True)})
            for values in itertools.product(*ends)
        ]
        if all(isinstance(corner, tuple) for corner in corners):
            hull = shapely.convex_hull(shapely.multipoints(cast("list[tuple[float, float]]", corners)))
            return clip([hull], bounds), True
    (west, east), (south, north) = vector_bounds(root)
    box = (max(west, bounds[0]), max(south, bounds[1]), min(east, bounds[2]), min(north, bounds[3]))
    if box == bounds:
        return None
    return ([shapes.box(*box)] if box[0] <= box[2] and box[1] <= box[3] else []), False


def allowed_place(scenario: Scenario, index: int, observed: Observation, bounds: Bounds) -> PossibleArea | None:
    """Where an object may be, as far as the values of the other objects' features are known.

    Args:
        scenario: The scenario.
        index: The object.
        observed: Values of features.
        bounds: What is drawn, in metres.

    Returns:
        None where anything is allowed, or nothing can be said.
    """
    owner = scenario.objects[index]
    given = owner.properties.get("position")
    if given is None or owner.mutated:
        return None
    pieces: list[Shape] = []
    exact = True
    try:
        root = condition(given.value, observed)
        if features(root):
            return None
        options = list(choices(root))
        for option in options:
            found = _reach(option, bounds)
            if found is None:
                return None
            pieces += found[0]
            exact = exact and found[1]
    except CannotEvaluate:
        return None
    return PossibleArea(_visible(pieces), exact, not features(given.value)) if options else None


def allowed_headings(scenario: Scenario, index: int, observed: Observation) -> tuple[FloatInterval, ...] | None:
    """The headings that an object may have, in radians; arguments and None as of `allowed_place`.

    Outer bounds where a heading is not affine. An interval may pass pi.
    """
    owner = scenario.objects[index]
    given = owner.properties.get("heading")
    if given is None or owner.mutated:
        return None
    try:
        root = condition(given.value, observed)
        if features(root):
            return None
        found = [scalar_bounds(option) for option in choices(root)]
    except CannotEvaluate:
        return None
    if not found or any(high - low >= math.tau for low, high in found):
        return None
    return tuple(found)


def views(scenario: Scenario, observed: Observation) -> tuple[Disc | Sector, ...]:
    """The view regions that the scenario's positions and requirements speak of, as far as they are known."""
    roots = [requirement.condition for requirement in scenario.requirements]
    roots += [owner.properties["position"].value for owner in scenario.objects if "position" in owner.properties]
    found: dict[tuple[float, ...], Disc | Sector] = {}
    for node in postorder(roots):
        if isinstance(node, SectorAt | DiscAt):
            known = condition(node, observed)
            region = known.value if isinstance(known, Constant) else None
            match region:
                case Disc():
                    found[*region.center, region.radius] = region
                case Sector():
                    found[*region.center, region.radius, region.heading, region.angle] = region
                case _:
                    pass
    return tuple(found.values())
