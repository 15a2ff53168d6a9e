"""Single affine features: inverted in closed form, the cheap second step of the cascade.

A feature whose random variables occur nowhere else is reachable exactly if the label's value, grown by its tolerance,
meets the set of values that its expression takes: an interval for a number, an arc for a heading, a polygon or a region
for a position.
"""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import shapely

from scenicq.forest.nodes import Constant, Identity, Leaf, Normal, PointIn, Range, TruncatedNormal, Value
from scenicq.geometry.proximity import meets, witness_point
from scenicq.geometry.regions import Region
from scenicq.geometry.shapes import XY, Coordinates
from scenicq.limits import LIMITS
from scenicq.match.linear.affine_forms import Affine, AffineVector, VariableAxis
from scenicq.match.tolerance import ROUNDING, Margin

__all__ = ["Reach", "ends", "reach_heading", "reach_number", "reach_position"]

_SIMILAR = 1e-12
"""How far a matrix may be from a similarity, relative to its scale."""
_FLAT = 1e-9
"""How thin places may lie along a line, relative to its length, to count as on it."""


@dataclass(frozen=True, slots=True)
class Reach:
    """Whether a value is reached.

    Attributes:
        possible: Yes, no, or not decided here.
        values: Values of the random variables, if it is satisfiable.
    """

    possible: bool | None
    values: Mapping[Identity, Value]


_NO = Reach(False, {})
_OPEN = Reach(None, {})


def ends(leaf: Leaf) -> tuple[float, float] | None:
    """The interval that a scalar random variable ranges over; None if its ends are random themselves."""
    match leaf:
        case Range():
            parameters = (leaf.low, leaf.high)
        case TruncatedNormal():
            parameters = (leaf.low, leaf.high)
        case Normal():
            return (-math.inf, math.inf)
        case _:
            return None
    values = [cast(float, part.value) for part in parameters if isinstance(part, Constant)]
    if len(values) != 2 or not all(isinstance(value, float) for value in values):
        return None
    return (min(values), max(values)) if isinstance(leaf, Range) else (values[0], values[1])


def _center(leaf: Leaf) -> float:
    if isinstance(leaf, Normal) and isinstance(leaf.mean, Constant):
        return cast(float, leaf.mean.value)
    return 0.0


def _between(form: Affine, leaves: Mapping[Identity, Leaf]) -> tuple[float, float] | None:
    low = high = form.constant
    for (identity, _), coefficient in form.terms.items():
        limits = ends(leaves[identity])
        if limits is None or limits[0] > limits[1]:
            return None
        products = sorted((coefficient * limits[0], coefficient * limits[1]))
        low, high = low + products[0], high + products[1]
    return low, high


def _reaching(form: Affine, leaves: Mapping[Identity, Leaf], value: float) -> dict[Identity, Value]:
    """Values of the variables for which the form takes a value between its bounds."""
    unbounded = [(v, c) for v, c in form.terms.items() if isinstance(leaves[v[0]], Normal)]
    if unbounded:
        fixed: dict[Identity, Value] = {}
        total = form.constant
        (first, coefficient), *_ = unbounded
        for (identity, axis), factor in form.terms.items():
            if (identity, axis) != first:
                limits = cast("tuple[float, float]", ends(leaves[identity]))
                chosen = _center(leaves[identity]) if math.isinf(limits[0]) else (limits[0] + limits[1]) / 2
                fixed[identity] = chosen
                total += factor * chosen
        return fixed | {first[0]: (value - total) / coefficient}
    low, high = cast("tuple[float, float]", _between(form, leaves))
    share = 0.5 if high == low else min(1.0, max(0.0, (value - low) / (high - low)))
    found: dict[Identity, Value] = {}
    for (identity, _), coefficient in form.terms.items():
        a, b = cast("tuple[float, float]", ends(leaves[identity]))
        found[identity] = a + share * (b - a) if coefficient > 0 else b - share * (b - a)
    return found


def reach_number(form: Affine, leaves: Mapping[Identity, Leaf], observed: float, tolerance: float) -> Reach:
    """Whether a number within a tolerance of the observed one is reached."""
    limits = _between(form, leaves)
    if limits is None:
        return _OPEN
    low, high = limits
    value = min(max(observed, low), high)
    if abs(value - observed) > tolerance + ROUNDING:
        return _NO
    return Reach(True, _reaching(form, leaves, value))


def reach_heading(form: Affine, leaves: Mapping[Identity, Leaf], observed: float, tolerance: float) -> Reach:
    """`reach_number` for a heading, modulo 2 pi."""
    limits = _between(form, leaves)
    if limits is None:
        return _OPEN
    low, high = limits
    if math.isinf(low) or math.isinf(high):
        return reach_number(form, leaves, observed, tolerance)
    first = math.floor((low - observed - tolerance) / math.tau)
    last = math.ceil((high - observed + tolerance) / math.tau)
    for turns in sorted(range(first, last + 1), key=lambda k: abs((low + high) / 2 - observed - math.tau * k)):
        found = reach_number(form, leaves, observed + math.tau * turns, tolerance)
        if found.possible:
            return found
    return _NO


def reach_position(
    form: AffineVector, leaves: Mapping[Identity, Leaf], observed: tuple[float, float], margin: Margin
) -> Reach:
    """Whether a position within tolerance of the observed one is reached."""
    variables = dict.fromkeys((*form[0].terms, *form[1].terms))
    points = {identity for identity, _ in variables if isinstance(leaves[identity], PointIn)}
    scalars = [variable for variable in variables if variable[0] not in points]
    limits = [ends(leaves[identity]) for identity, _ in scalars]
    bounded = [pair for pair in limits if pair is not None and all(map(math.isfinite, pair)) and pair[0] <= pair[1]]
    if len(points) > 1 or len(bounded) != len(limits) or len(bounded) > LIMITS.inverted_offsets:
        return _OPEN
    corners = list(itertools.product(*bounded))
    if points:
        (point,) = points
        return _from_region(form, cast(PointIn, leaves[point]), scalars, corners, observed, margin)
    places = np.array([_offset(form, scalars, corner) for corner in corners])
    shape, radius = margin.around(observed)
    hull = shapely.MultiPoint(places).convex_hull
    if shapely.distance(hull, shape) > radius + ROUNDING:
        return _NO
    target = shapely.shortest_line(hull, shape).coords[0]
    return Reach(True, _between_corners(scalars, corners, places, (target[0], target[1])))


def _offset(form: AffineVector, variables: list[VariableAxis], values: tuple[float, ...]) -> tuple[float, float]:
    given = dict(zip(variables, values, strict=True))
    x, y = (part.constant + sum(part.terms.get(v, 0.0) * value for v, value in given.items()) for part in form)
    return x, y


def _from_region(
    form: AffineVector,
    leaf: PointIn,
    scalars: list[VariableAxis],
    corners: list[tuple[float, ...]],
    observed: tuple[float, float],
    margin: Margin,
) -> Reach:
    """A point of a region, moved by a similarity and random offsets: bring the label back into the region's frame."""
    if not isinstance(leaf.region, Constant):
        return _OPEN
    x, y = (leaf.identity, 0), (leaf.identity, 1)
    (a, b), (c, d) = rows = [(part.terms.get(x, 0.0), part.terms.get(y, 0.0)) for part in form]
    area = abs(a * d - b * c)
    # the rows are orthogonal and of one length
    residues = abs(a * a + b * b - area), abs(c * c + d * d - area), abs(a * c + b * d)
    if area == 0 or max(residues) > _SIMILAR * (1 + area):
        return _OPEN
    matrix, size = np.array(rows), math.sqrt(area)
    shape, radius = margin.around(observed)
    around = np.array(shapely.get_coordinates(shape))
    back = np.linalg.inv(matrix)
    offsets = np.array([_offset(form, scalars, corner) for corner in corners])
    places = ((around[:, None, :] - offsets[None, :, :]).reshape(-1, 2)) @ back.T
    wanted = shapely.Point(places[0]) if len(places) == 1 else shapely.MultiPoint(places).convex_hull
    region = cast(Region, leaf.region.value)
    answer = meets(region, wanted, radius / size)
    if not answer:
        return Reach(answer, {})
    point = witness_point(region, wanted, radius / size)
    if point is None:
        return _OPEN
    if not scalars:
        return Reach(True, {leaf.identity: point})
    moved = matrix @ np.array(point)
    reached = [(float(px + moved[0]), float(py + moved[1])) for px, py in offsets]
    hull = shapely.MultiPoint(reached).convex_hull
    target = shapely.shortest_line(hull, shape).coords[0]
    values = _between_corners(scalars, corners, np.array(reached), (target[0], target[1]))
    return Reach(True, {leaf.identity: point, **values})


def _between_corners(
    scalars: Sequence[VariableAxis], corners: Sequence[tuple[float, ...]], places: Coordinates, target: XY
) -> dict[Identity, Value]:
    """Values of the offsets that lead to a target inside the hull of the places of their corners.

    What lies between two or three places is reached by the values between their corners.
    """
    away, goal = places - places[0], np.array(target) - places[0]
    along = np.linalg.svd(away)[2][0]
    ahead, aside = away @ along, away @ np.array([-along[1], along[0]])
    if np.ptp(aside) <= _FLAT * (1.0 + np.ptp(ahead)):
        least, most = int(ahead.argmin()), int(ahead.argmax())
        part = float(goal @ along - ahead[least]) / (float(np.ptp(ahead)) or 1.0)
        chosen, shares = [least, most], np.array([1.0 - part, part])
    else:
        outline = shapely.get_coordinates(shapely.MultiPoint(away).convex_hull)[:-1]
        hull = [int(np.hypot(*(away - each).T).argmin()) for each in outline]
        found = [([hull[0], *ends], _shares(away[[hull[0], *ends]], goal)) for ends in itertools.pairwise(hull[1:])]
        chosen, shares = max(found, key=lambda each: float(each[1].min()))
    shares = np.clip(shares, 0.0, 1.0)
    values = shares / shares.sum() @ np.array([corners[number] for number in chosen])
    return {identity: float(value) for (identity, _), value in zip(scalars, values.tolist(), strict=True)}


def _shares(triangle: Coordinates, point: Coordinates) -> Coordinates:
    """The parts of three places of which a point is made: negative where it lies outside of their triangle."""
    one, other = triangle[1:] - triangle[0]
    away, area = point - triangle[0], float(one[0] * other[1] - one[1] * other[0])
    if abs(area) <= _FLAT * float(np.hypot(*one) * np.hypot(*other)):
        # what lies in it lies beside one that is wider
        return np.array([-math.inf, 0.0, 0.0])
    first = float(away[0] * other[1] - away[1] * other[0]) / area
    second = float(one[0] * away[1] - one[1] * away[0]) / area
    return np.array([1.0 - first - second, first, second])
