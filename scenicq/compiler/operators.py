"""Scenic's operators on values (language paper, tables 2-4 and appendix B.4-B.9).

Every function takes evaluated values and the span of the construct; the ego is passed in where an operator refers to
it.
"""

from __future__ import annotations

import math

from scenicq.compiler.absent import absent_parts, list_names
from scenicq.compiler.coerce import (
    apart_from_height,
    kind_of_model,
    property_node,
    to_boolean,
    to_field,
    to_heading,
    to_node,
    to_region,
    to_scalar,
    to_vector,
)
from scenicq.compiler.roots import oriented_point
from scenicq.compiler.values import DelayedValue, Instance, ModelValue, describe, fail, is_node
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.compute import fold
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import (
    ArithmeticOp,
    CompareOp,
    Constant,
    Contains,
    DirectionAt,
    Distance,
    Encloses,
    Intersects,
    LogicOp,
    Node,
    RegionDifference,
    RegionIntersection,
    RegionUnion,
    Select,
    Undefined,
)
from scenicq.geometry.regions import DifferenceOf, IntersectionOf, PolylineSet, UnionOf
from scenicq.geometry.road_direction import along_lines
from scenicq.limits import LIMITS

__all__ = [
    "along",
    "angle_to",
    "apparent_heading",
    "binary",
    "can_see",
    "combine",
    "compare",
    "degrees",
    "direction_at",
    "distance_past",
    "distance_to",
    "existing",
    "intersects",
    "is_field",
    "make_oriented_point",
    "negate",
    "object_box",
    "offset",
    "region_difference",
    "region_intersection",
    "region_union",
    "relative_heading",
    "relative_to",
    "visible_region",
    "within",
]


_BINARY: dict[str, ArithmeticOp] = {op.value: op for op in ArithmeticOp if not op.value[0].isalpha()}
_COMPARE: dict[str, CompareOp] = {op.value: op for op in CompareOp}


def is_field(value: ModelValue) -> bool:
    """Whether a value is a vector field."""
    return is_node(value) and kind_of(value) == "field"


def _is_vector(value: ModelValue) -> bool:
    return kind_of_model(value) == "vector" or isinstance(value, Instance)


def _is_polyline(value: ModelValue) -> bool:
    """Whether a value is a polyline, or a region that is one in every outcome."""
    todo = [value]
    while todo:
        match todo.pop():
            case Select() as choice:
                todo += choice.options
            case RegionUnion() as union:
                todo += union.parts
            case Constant(value=PolylineSet() | Undefined()):
                pass
            case _:
                return False
    return True


def _joined_lines(left: ModelValue, right: ModelValue, span: Span) -> Node:
    """The lines of one polyline, then those of another."""
    sets = [each.value for each in (left, right) if isinstance(each, Constant) and isinstance(each.value, PolylineSet)]
    if len(sets) < 2:
        return region_union(left, right, span)
    lines, name = sets[0].lines + sets[1].lines, f"{sets[0].name} + {sets[1].name}"
    return build.constant(PolylineSet(lines, name, along_lines(lines, name)), span)


def binary(op: str, left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    """Python's arithmetic where at least one side is an expression."""
    if _is_vector(left) or _is_vector(right):
        if op in "+-":
            combined = build.vector_sum if op == "+" else build.vector_difference
            return combined(to_vector(left, span), to_vector(right, span), span)
        if op == "*" and _is_vector(left) != _is_vector(right):
            vector, factor = (left, right) if _is_vector(left) else (right, left)
            return build.scale(to_vector(vector, span), to_scalar(factor, span), span)
        if op == "/" and not _is_vector(right):
            one = build.arithmetic(ArithmeticOp.DIV, build.constant(1.0), to_scalar(right, span), span=span)
            return build.scale(to_vector(left, span), one, span)
        raise fail("wrong-type", f"`{op}` has no meaning for a vector", span, "on a vector")
    if op == "+" and _is_polyline(left) and _is_polyline(right):
        return _joined_lines(left, right, span)
    if op not in _BINARY:
        raise fail("unsupported-construct", f"`{op}` is not supported on random values", span, "on a random value")
    return build.arithmetic(_BINARY[op], to_scalar(left, span), to_scalar(right, span), span=span)


def negate(value: ModelValue, span: Span) -> ModelValue:
    """Unary minus of an expression."""
    if _is_vector(value):
        return build.scale(to_vector(value, span), build.constant(-1.0), span)
    return build.arithmetic(ArithmeticOp.NEG, to_scalar(value, span), span=span)


def compare(op: str, left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    """A comparison where at least one side is an expression."""
    if op in ("==", "!="):
        return build.compare(_COMPARE[op], to_node(left, span), to_node(right, span), span)
    return build.compare(_COMPARE[op], to_scalar(left, span), to_scalar(right, span), span)


def combine(op: str, values: list[ModelValue], span: Span) -> ModelValue:
    """`and`, `or`, `not` of expressions."""
    return build.logic(LogicOp(op), *(to_boolean(value, span) for value in values), span=span)


def direction_at(field: ModelValue, point: ModelValue, span: Span | None) -> Node:
    """`F at V`: the direction of a vector field."""
    return DirectionAt(to_field(field, span), to_vector(point, span), span=span)


def relative_to(left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    """`X relative to Y`: headings and fields add up, a vector is offset from an oriented point or another vector."""
    if is_field(left) or is_field(right):
        for value in (left, right):
            if not is_field(value):
                to_heading(value, span)

        def at_object(value: ModelValue, instance: Instance) -> Node:
            position = property_node(instance, "position", span)
            return direction_at(value, position, span) if is_field(value) else to_heading(value, span)

        return DelayedValue(
            frozenset({"position"}),
            lambda instance: build.add(at_object(left, instance), at_object(right, instance), span),
        )
    if _is_offset(left):
        return offset(right, left, span)
    if _is_offset(right):
        return offset(left, right, span)
    if isinstance(left, Instance) and isinstance(right, Instance):
        raise fail("wrong-type", "`relative to` of two oriented points is ambiguous", span, "a heading or a position?",
                   ("write `A.heading relative to B.heading` or `A.position relative to B`",))  # fmt: skip
    return build.add(to_heading(left, span), to_heading(right, span), span)


def _is_offset(value: ModelValue) -> bool:
    """Whether a value has a position but no heading."""
    if isinstance(value, Instance):
        return not value.oriented
    return kind_of_model(value) == "vector" or isinstance(value, tuple | list)


def offset(origin: ModelValue, by: ModelValue, span: Span) -> ModelValue:
    """`O offset by V`: in the frame of an oriented point, else plain addition."""
    (start, base), (away, height) = apart_from_height(origin), apart_from_height(by)
    if isinstance(start, Instance) and start.oriented:
        position = build.offset_local(to_vector(start, span), to_heading(start, span), to_vector(away, span), span)
        return make_oriented_point(_raised(position, base, height, span), to_heading(start, span))
    return _raised(build.vector_sum(to_vector(start, span), to_vector(away, span), span), base, height, span)


def along(origin: ModelValue, direction: ModelValue, by: ModelValue, span: Span) -> ModelValue:
    """`V offset along D by V`, where D is a heading or a field taken at the origin."""
    (start, base), (away, height) = apart_from_height(origin), apart_from_height(by)
    place = to_vector(start, span)
    heading = direction_at(direction, place, span) if is_field(direction) else to_heading(direction, span)
    return _raised(build.offset_local(place, heading, to_vector(away, span), span), base, height, span)


def _raised(place: Node, base: ModelValue, height: ModelValue, span: Span) -> ModelValue:
    """A vector of the plane at a height; one that is high is written with three coordinates."""
    if base in (0, 0.0) and height in (0, 0.0):
        return place
    up = build.add(to_scalar(base, span), to_scalar(height, span), span)
    return build.coordinate(place, 0, span), build.coordinate(place, 1, span), up


def make_oriented_point(position: ModelValue, heading: Node) -> Instance:
    """An oriented point."""
    return oriented_point({"position": position, "heading": heading})


def relative_heading(target: ModelValue, origin: ModelValue, span: Span) -> Node:
    """`relative heading of H from H`, normalised."""
    turned = build.minus(to_heading(target, span), to_heading(origin, span), span)
    return build.arithmetic(ArithmeticOp.WRAP, turned, span=span)


def apparent_heading(target: ModelValue, origin: ModelValue, span: Span) -> Node:
    """`apparent heading of OP from V`: the heading relative to the line of sight."""
    if not (isinstance(target, Instance) and target.oriented):
        raise fail("wrong-type", "`apparent heading of` needs an oriented point", span, f"this is {describe(target)}")
    line = build.vector_difference(to_vector(target, span), to_vector(origin, span), span)
    turned = build.minus(to_heading(target, span), build.bearing(line, span), span)
    return build.arithmetic(ArithmeticOp.WRAP, turned, span=span)


def angle_to(target: ModelValue, origin: ModelValue, span: Span) -> Node:
    """`angle from V to V`: the heading of the line of sight."""
    return build.bearing(build.vector_difference(to_vector(target, span), to_vector(origin, span), span), span)


def distance_to(target: ModelValue, origin: ModelValue, span: Span) -> Node:
    """`distance from X to Y`: between positions, or to a region (0 inside)."""
    for region, point in ((target, origin), (origin, target)):
        if kind_of_model(region) == "region":
            return fold(Distance(existing(region, span), to_vector(point, span), span=span))
    return build.norm(build.vector_difference(to_vector(target, span), to_vector(origin, span), span), span)


def distance_past(point: ModelValue, origin: ModelValue, span: Span) -> Node:
    """`distance past V of OP`: how far OP is ahead of V along OP's own heading."""
    if not (isinstance(origin, Instance) and origin.oriented):
        raise fail(
            "wrong-type", "`distance past` needs an oriented point or object", span, f"this is {describe(origin)}"
        )
    line = build.vector_difference(to_vector(origin, span), to_vector(point, span), span)
    back = build.arithmetic(ArithmeticOp.NEG, to_heading(origin, span), span=span)
    return build.coordinate(build.rotate(line, back, span), 1, span)


def visible_region(viewer: ModelValue, span: Span | None) -> Node:
    """What a point, oriented point or object sees (appendix B: visibleRegion)."""
    if not isinstance(viewer, Instance):
        raise fail("wrong-type", "only a point, oriented point or object can see", span, f"this is {describe(viewer)}")
    center = to_vector(viewer, span)
    radius = to_scalar(property_node(viewer, "visibleDistance", span), span)
    if not viewer.oriented:
        return build.sector(center, radius, None, None, span)
    heading = to_heading(viewer, span)
    if "cameraOffset" in viewer.properties:
        camera = to_vector(viewer.properties["cameraOffset"], span)
        if not (isinstance(camera, Constant) and camera.value == (0.0, 0.0)):
            center = build.offset_local(center, heading, camera, span)
    angle = to_scalar(property_node(viewer, "viewAngle", span), span)
    return build.sector(center, radius, heading, angle, span)


def object_box(instance: Instance, span: Span | None) -> Node:
    """The bounding box of an object."""
    width, length = (to_scalar(property_node(instance, name, span), span) for name in ("width", "length"))
    return build.box(to_vector(instance, span), to_heading(instance, span), width, length, span)


def _is_object(value: ModelValue) -> bool:
    return isinstance(value, Instance) and value.index is not None


def can_see(viewer: ModelValue, target: ModelValue, span: Span) -> Node:
    """`X can see Y`: the visible region holds the point or meets the object's box."""
    seen = visible_region(viewer, span)
    if _is_object(target):
        return fold(Intersects(seen, object_box(target, span), span=span))
    return fold(Contains(seen, to_vector(target, span), span=span))


def existing(value: ModelValue, span: Span | None) -> Node:
    """A region that something is placed in or tested against.

    Raises:
        ScenarioError: map-lacks, where the map has nothing of the kind; wrong-type.
    """
    if value is None:
        raise fail("map-lacks", "the map has no such element", span, "there is none here", _ELSEWHERE)
    area = to_region(value, span)
    names = absent_parts(area)
    if names is not None:
        raise fail("map-lacks", f"the map has nothing for {list_names(names)}", span, "there is none", _ELSEWHERE)
    return area


_ELSEWHERE = ("the map of another dataset may have it", "leave out what needs it")


def within(item: ModelValue, region: ModelValue, span: Span) -> Node:
    """`X in R`: a point in a region; an object with all of its box."""
    area = existing(region, span)
    if _is_object(item):
        return fold(Encloses(area, object_box(item, span), span=span))
    return fold(Contains(area, to_vector(item, span), span=span))


def intersects(left: ModelValue, right: ModelValue, span: Span) -> Node:
    """`X intersects Y` of objects and regions."""
    shapes = [object_box(value, span) if _is_object(value) else existing(value, span) for value in (left, right)]
    return fold(Intersects(shapes[0], shapes[1], span=span))


def _combined(parts: tuple[Node, ...], made: Node, span: Span) -> Node:
    """A region made from others, unless it grows beyond all bounds (shared parts count as often as they are used)."""
    size, stack = 0, [*parts]
    while stack and size <= LIMITS.region_parts:
        part = stack.pop()
        size += 1
        match part:
            case RegionUnion() | RegionIntersection():
                stack += part.parts
            case RegionDifference():
                stack += [part.base, part.removed]
            case Select():
                stack += part.options
            case Constant(value=UnionOf() | IntersectionOf() as region):
                stack += [Constant(inner) for inner in region.parts]
            case Constant(value=DifferenceOf() as region):
                stack += [Constant(region.base), Constant(region.removed)]
            case _:
                pass
    if size > LIMITS.region_parts:
        raise fail(
            "budget-exceeded", f"a region is combined from more than {LIMITS.region_parts:,} parts", span, "grows here"
        )
    return fold(made)


def region_union(left: ModelValue, right: ModelValue, span: Span) -> Node:
    """What lies in either region."""
    parts = to_region(left, span), to_region(right, span)
    return parts[0] if parts[0] is parts[1] else _combined(parts, RegionUnion(parts, span=span), span)


def region_intersection(left: ModelValue, right: ModelValue, span: Span) -> Node:
    """What lies in both regions."""
    parts = to_region(left, span), to_region(right, span)
    return parts[0] if parts[0] is parts[1] else _combined(parts, RegionIntersection(parts, span=span), span)


def region_difference(left: ModelValue, right: ModelValue, span: Span) -> Node:
    """What lies in the left region only."""
    parts = to_region(left, span), to_region(right, span)
    return _combined(parts, RegionDifference(*parts, span=span), span)


def degrees(value: ModelValue, span: Span) -> ModelValue:
    """`S deg`."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return math.radians(value)
    return build.arithmetic(ArithmeticOp.MUL, to_scalar(value, span), build.constant(math.pi / 180), span=span)
