"""What a program may read of regions: methods of any region, and parts of known ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from inspect import signature
from itertools import pairwise
from typing import cast

from shapely.geometry import LineString, Point
from shapely.ops import nearest_points

from scenicq.compiler import operators
from scenicq.compiler.coerce import kind_of_model, to_scalar, to_vector
from scenicq.compiler.elements import MISSING
from scenicq.compiler.random_values import possible_values
from scenicq.compiler.values import Builtin, Choice, ModelValue, fail
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.bounds import scalar_bounds
from scenicq.forest.nodes import ArithmeticOp, CompareOp, Constant, Node, PointIn, Select
from scenicq.geometry.angles import heading_of
from scenicq.geometry.regions import XY, PolygonSet, PolylineSet, Region, orientation_of
from scenicq.geometry.road_direction import along_lines
from scenicq.geometry.shapes import simple_parts, union_all
from scenicq.limits import LIMITS

__all__ = ["REGION_METHODS", "corner", "holds_regions", "of_region"]


def holds_regions(choice: Choice) -> bool:
    """Whether each outcome of a random choice is a region."""
    return all(kind_of_model(each) == "region" for each in possible_values(choice))


def of_region(value: Node, name: str, span: Span) -> ModelValue:
    """An attribute of a region, `MISSING` where it has none of this name, or not as one region."""
    if name in REGION_METHODS:
        return REGION_METHODS[name](value)
    match name:
        case "orientation" if isinstance(value, Constant):
            field = orientation_of(cast(Region, value.value))
            return None if field is None else build.constant(field, span)
        case "start" | "end" if (points := _line(value)) is not None:
            (x, y), (u, v) = points[:2] if name == "start" else points[-2:]
            place = points[0] if name == "start" else points[-1]
            return operators.make_oriented_point(
                build.constant(place, span), build.constant(heading_of(u - x, v - y), span)
            )
        case "points" if (points := _line(value)) is not None:
            return tuple(build.constant(point, span) for point in points)
        case "footprint" if isinstance(value, Constant) and isinstance(value.value, PolygonSet):
            return value
        case "boundary" if isinstance(value, Constant) and isinstance(value.value, PolygonSet):
            return _boundary(value.value, span)
        case "pointAlongBy" if isinstance(value, Constant) and isinstance(value.value, PolylineSet):
            region = value.value
            return Builtin(
                name, lambda span, by, normalized=False: _point_along(region, by, span, normalized=normalized)
            )
        case "project" if isinstance(value, Constant) and isinstance(value.value, PolylineSet):
            lines = value.value
            return Builtin(name, lambda span, point: _projected(lines, to_vector(point, span), span))
        case "length" if isinstance(value, Constant) and isinstance(value.value, PolylineSet):
            return float(sum(line.length for line in value.value.lines))
        case _:
            return MISSING


def _point(value: Node, span: Span) -> Node:
    return PointIn(operators.existing(value, span), span=span)


def _method(name: str, make: Callable[..., ModelValue], cost: int = 0) -> Callable[[Node], Builtin]:
    operands = list(signature(make).parameters)[1:-1]

    def call(value: Node, span: Span, *given: ModelValue) -> ModelValue:
        if len(given) != len(operands):
            raise TypeError(f"{name}() takes {', '.join(operands) or 'nothing'}")
        return make(value, *given, span)

    return lambda value: Builtin(name, partial(call, value), cost=cost)


REGION_METHODS: dict[str, Callable[[Node], Builtin]] = {
    name: _method(name, make, cost)
    for name, make, cost in (
        ("union", operators.region_union, 800),
        ("intersect", operators.region_intersection, 800),
        ("difference", operators.region_difference, 800),
        ("intersects", operators.intersects, 0),
        ("containsPoint", lambda value, point, span: operators.within(to_vector(point, span), value, span), 0),
        ("containsObject", lambda value, thing, span: operators.within(thing, value, span), 0),
        ("distanceTo", operators.distance_to, 0),
        ("uniformPointInner", _point, 0),
        ("uniformPoint", _point, 0),
    )
}
"""Methods that mean the same of any region, a random one as well."""


def _boundary(region: PolygonSet, span: Span) -> ModelValue:
    """The border of a single polygon, directed along itself."""
    if len(region.polygons) != 1:
        return MISSING
    lines = cast("tuple[LineString, ...]", tuple(simple_parts([region.polygons[0].boundary])))
    return build.constant(PolylineSet(lines, region.name, along_lines(lines, region.name)), span)


def _point_along(region: PolylineSet, by: ModelValue, span: Span, *, normalized: ModelValue) -> Node:
    """The point at a distance along a line, in metres or as a share of its length; from its end if negative."""
    if len(region.pieces) != 1:
        raise fail("unsupported-construct", "this point along a line is not supported", span,
                   "several lines", ("place something `on` the line",))  # fmt: skip
    line = cast(LineString, region.pieces[0]).simplify(0.0)
    distance = to_scalar(by, span)
    if normalized:
        distance = build.arithmetic(ArithmeticOp.MUL, distance, build.constant(line.length, span), span=span)
    if isinstance(distance, Constant):
        point = line.interpolate(float(cast(float, distance.value)))
        return build.constant((float(point.x), float(point.y)), span)
    from_end = build.add(distance, build.constant(line.length, span), span)
    low, high = scalar_bounds(distance)
    if high < 0:
        distance = from_end
    elif low < 0:
        is_negative = build.compare(CompareOp.LT, distance, build.constant(0.0, span), span)
        distance = Select(is_negative, (distance, from_end), span=span)
    return _sum_of_segments([(x, y) for x, y in line.coords], distance, span)


def _sum_of_segments(corners: list[XY], distance: Node, span: Span) -> Node:
    """The first corner and, along each segment, as much of the distance as falls on it."""
    low, high = scalar_bounds(distance)
    place, passed = build.constant(corners[0], span), 0.0
    for (x, y), (u, v) in pairwise(corners):
        length = math.dist((x, y), (u, v))
        if low >= passed + length:
            place = build.constant((u, v), span)
        elif high > passed:
            beyond = build.minus(distance, build.constant(passed, span), span)
            share = build.arithmetic(ArithmeticOp.DIV, beyond, build.constant(length, span), span=span)
            share = build.arithmetic(ArithmeticOp.MAX, share, build.constant(0.0, span), span=span)
            share = build.arithmetic(ArithmeticOp.MIN, share, build.constant(1.0, span), span=span)
            place = build.vector_sum(place, build.scale(build.constant((u - x, v - y), span), share, span), span)
        passed += length
    return place


def _projected(region: PolylineSet, point: Node, span: Span) -> Node:
    """The point of lines that is nearest to a point: of several the first one."""
    if isinstance(point, Constant):
        lines = union_all(list(region.lines))
        nearest = nearest_points(lines, Point(*cast("XY", point.value)))[0]
        return build.constant((float(nearest.x), float(nearest.y)), span)
    segments = [ends for line in region.pieces for ends in pairwise([(x, y) for x, y in line.simplify(0.0).coords])]
    if len(segments) > LIMITS.projection_segments:
        raise fail("budget-exceeded", f"the line has more than {LIMITS.projection_segments} segments", span,
                   "a point that is not known is projected here", ("place something `on` the line",))  # fmt: skip
    found: Node | None = None
    least: Node | None = None
    for start, end in segments:
        place = _nearest_on(start, end, point, span)
        away = build.norm(build.vector_difference(point, place, span), span)
        if found is None or least is None:
            found, least = place, away
            continue
        found = Select(build.compare(CompareOp.LT, away, least, span), (found, place), span=span)
        least = build.arithmetic(ArithmeticOp.MIN, away, least, span=span)
    assert found is not None
    return found


def _nearest_on(start: XY, end: XY, point: Node, span: Span) -> Node:
    """The point of a segment that is nearest to a point."""
    (x, y), (u, v) = start, end
    along, square = (u - x, v - y), (u - x) ** 2 + (v - y) ** 2
    offset = build.vector_difference(point, build.constant(start, span), span)
    parts = [
        build.arithmetic(
            ArithmeticOp.MUL, build.coordinate(offset, axis), build.constant(along[axis] / square), span=span
        )
        for axis in (0, 1)
    ]
    share = build.arithmetic(
        ArithmeticOp.MAX, build.add(parts[0], parts[1], span), build.constant(0.0, span), span=span
    )
    share = build.arithmetic(ArithmeticOp.MIN, share, build.constant(1.0, span), span=span)
    return build.vector_sum(build.constant(start, span), build.scale(build.constant(along, span), share, span), span)


def _line(value: ModelValue) -> list[tuple[float, float]] | None:
    """The corners of a polyline, pieces one after the other; None for other regions."""
    if not (isinstance(value, Constant) and isinstance(value.value, PolylineSet)):
        return None
    return [(float(x), float(y)) for line in value.value.pieces for x, y in line.coords]


def corner(value: ModelValue, index: ModelValue, span: Span) -> ModelValue:
    """`polyline[n]`.

    Raises:
        ScenarioError: wrong-type for other regions, runtime-error where there is no such corner.
    """
    points = _line(value)
    if points is None:
        raise fail("wrong-type", "a region has no items", span, "indexed here", ("only polylines have corners",))
    if not isinstance(index, int) or not -len(points) <= index < len(points):
        raise fail("runtime-error", "there is no item with this index", span, "not found")
    return build.constant(points[index], span)
