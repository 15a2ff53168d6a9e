"""The meaning of every node that is not random: its value from the values of its children.

The formulas are those of the language paper's appendix B. A value that does not exist (the road's direction far from
roads, a division by zero) is `Undefined` and spreads to whatever uses it; a question that geometry cannot answer
raises `CannotEvaluate`, which the matcher reports as unknown, never as no.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, cast

from scenicq.errors import CannotEvaluate
from scenicq.forest.kinds import kind_of_value
from scenicq.forest.nodes import (
    AheadInLanes,
    Among,
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    Constant,
    Contains,
    Coordinate,
    Corridor,
    CourseCoordinate,
    DirectionAt,
    DiscAt,
    Distance,
    Encloses,
    Intersects,
    LaneCourse,
    Logic,
    Measure,
    Node,
    Norm,
    RectangleAt,
    RegionDifference,
    RegionIntersection,
    RegionUnion,
    Rotate,
    Scale,
    SectorAt,
    Select,
    Undefined,
    Value,
    Vector,
    VectorOf,
    VectorSum,
)
from scenicq.forest.scalars import arithmetic, compare, connect
from scenicq.forest.walk import children, is_leaf
from scenicq.geometry.angles import azimuth, rotate, wrap
from scenicq.geometry.boxes import box_polygon
from scenicq.geometry.containment import covers, overlaps
from scenicq.geometry.driven_courses import CoursePlace, lane_course
from scenicq.geometry.fields import VectorField
from scenicq.geometry.lane_stretches import ahead_in_lanes
from scenicq.geometry.measures import MovingBoxes, measure_tracks, time_to_collision
from scenicq.geometry.membership import contains, distance
from scenicq.geometry.network import Network
from scenicq.geometry.occupancy import ElementAtPoint
from scenicq.geometry.regions import (
    Disc,
    Nowhere,
    PolygonSet,
    Rectangle,
    Region,
    Sector,
    difference,
    intersection,
    union,
)
from scenicq.geometry.shapes import GeometryError

__all__ = ["FAR_M", "compute", "directions", "fold"]


FAR_M = 1e12
"""Metres that stand for any greater distance along a course, with which can be reckoned."""


_Numbers = tuple[float, ...]


def _intersects(left: Region, right: Region) -> bool:
    answer = overlaps(left, right)
    if answer is None:
        raise CannotEvaluate(f"whether a {type(left).__name__} and a {type(right).__name__} intersect")
    return answer


def _encloses(outer: Region, inner: Region) -> bool:
    if not isinstance(inner, Rectangle):
        raise CannotEvaluate(f"whether a {type(inner).__name__} lies inside a region")
    answer = covers(outer, box_polygon(*inner.center, inner.heading, inner.width, inner.length))
    if answer is None:
        raise CannotEvaluate(f"whether a {type(outer).__name__} holds a box")
    return answer


def _course_coordinate(node: CourseCoordinate, course: CoursePlace, x: float, y: float) -> float:
    low, high = course.ends(x, y)[2 * node.axis : 2 * node.axis + 2]
    if node.end is not None:
        return min(max(high if node.end else low, -FAR_M), FAR_M)
    if low != high:
        where = "of the course" if math.isfinite(low) and math.isfinite(high) else "beyond the end of the course"
        raise CannotEvaluate(f"which place {where} it is at")
    return low


def _track_measure(node: Measure, courses: tuple[CoursePlace, ...]) -> float:
    low, high = measure_tracks(node.measure, courses, node.seconds)
    if node.end is not None:
        return high if node.end else low
    if low != high:
        raise CannotEvaluate("how the track goes on")
    return low


def directions(field: Value, point: Value, going: Value = None, last: Value = None) -> tuple[float, ...] | Undefined:
    """The headings that a vector field allows at a point, at least one; `Undefined` where it has none.

    Args:
        field: The field.
        point: The point.
        going: The heading of who is there, where it matters; None if there is none.
        last: The last lane of its track likewise.

    Raises:
        CannotEvaluate: If they are no field and no point.
    """
    for arg in (field, point, going, last):
        if isinstance(arg, Undefined):
            return arg
    if kind_of_value(field) != "field" or not isinstance(point, tuple):
        raise CannotEvaluate(f"the direction of {field!r} at {point!r}")
    x, y = point
    if isinstance(field, ElementAtPoint) and isinstance(going, float):
        return (field.along(x, y, going, last if isinstance(last, float) else math.nan),)
    allowed = cast(VectorField, field).values(x, y)
    name = getattr(field, "name", "the field")
    return allowed or Undefined(f"`{name}` is undefined at ({x:.2f}, {y:.2f})")


def compute(node: Node, args: tuple[Value, ...]) -> Value:
    """The value of a node that is neither random nor a feature nor a `DirectionAt`.

    Args:
        node: The node.
        args: The values of its children, in their order.

    Raises:
        CannotEvaluate: If geometry cannot decide.
    """
    match node:
        case Constant():
            return node.value
        case Select():
            picked = args[0]
            if isinstance(picked, Undefined):
                return picked
            if not isinstance(picked, float | bool):
                raise CannotEvaluate(f"what {picked!r} picks")
            return args[1 + int(picked)]
        case Logic():
            return connect(node.op, args)
        case _:
            pass
    for arg in args:
        if isinstance(arg, Undefined):
            return arg
    try:
        return _compute(node, args)
    except (ArithmeticError, TypeError, ValueError, GeometryError) as error:
        # such as numbers that are finite and whose sum is not
        raise CannotEvaluate(f"{type(node).__name__} of these values: {error}") from None


def _compute(node: Node, args: tuple[Value, ...]) -> Value:
    given = cast("tuple[object, ...]", args)
    match node, given:
        case Arithmetic(op=ArithmeticOp.WRAP), (angle,):
            return wrap(cast(float, angle))
        case Arithmetic(), _:
            return arithmetic(node.op, cast(_Numbers, args))
        case Coordinate(), ((float() as x, float() as y),):
            return y if node.axis else x
        case Norm(), ((float() as x, float() as y),):
            return math.hypot(x, y)
        case Bearing(), ((float() as x, float() as y),):
            return azimuth(x, y)
        case VectorOf(), (float() as x, float() as y):
            return (x, y)
        case VectorSum(), ((float() as x, float() as y), (float() as u, float() as v)):
            return (x + u, y + v)
        case Scale(), ((float() as x, float() as y), float() as factor):
            return (x * factor, y * factor)
        case Rotate(), ((float() as x, float() as y), float() as angle):
            return rotate(x, y, angle)
        case Compare(), (left, right):
            return compare(node.op, cast(Value, left), cast(Value, right))
        case _:
            return _compute_region(node, args)


def _compute_region(node: Node, args: tuple[Value, ...]) -> Value:
    numbers = cast(_Numbers, args[1:])
    given = cast("tuple[object, ...]", args)
    match node, given:
        case DiscAt(), _:
            return Disc(cast(Vector, args[0]), *numbers)
        case SectorAt(), _:
            return Sector(cast(Vector, args[0]), *numbers)
        case RectangleAt(), _:
            return Rectangle(cast(Vector, args[0]), *numbers)
        case RegionUnion(), _:
            return union(*cast("tuple[Region, ...]", args))
        case RegionIntersection(), _:
            return intersection(*cast("tuple[Region, ...]", args))
        case RegionDifference(), (base, removed):
            return difference(cast(Region, base), cast(Region, removed))
        case Contains(), (region, (float() as x, float() as y)):
            return contains(cast(Region, region), x, y)
        case Distance(), (region, (float() as x, float() as y)):
            return distance(cast(Region, region), x, y)
        case CourseCoordinate(), (CoursePlace() as course, (float() as x, float() as y)):
            return _course_coordinate(node, course, x, y)
        case Measure(), _ if all(isinstance(each, CoursePlace) for each in given):
            return _track_measure(node, cast("tuple[CoursePlace, ...]", given))
        case Measure(measure="time_to_collision"), _:
            boxes = [MovingBoxes(*cast("tuple[Any, ...]", args[first : first + 5])) for first in (0, 5)]
            return float(time_to_collision(boxes[0], boxes[1]))
        case LaneCourse(), ((float() as x, float() as y), float() as heading):
            return lane_course(node.network, x, y, heading)
        case Corridor(), (CoursePlace() as course, float() as half_width):
            if course.line is None:
                raise CannotEvaluate("there is no course")
            return course.line.within(half_width)
        case AheadInLanes(), ((float() as x, float() as y), way, last, float() as metres):
            return _ahead(node.network, x, y, _known(way), _known(last), metres)
        case Intersects(), (left, right):
            return _intersects(cast(Region, left), cast(Region, right))
        case Encloses(), (outer, inner):
            return _encloses(cast(Region, outer), cast(Region, inner))
        case Among(), _:
            raise CannotEvaluate("what holds of label objects without a role")
        case _:
            raise TypeError(f"no value for {args!r}")


def _known(value: object) -> float | None:
    """A number; None where there is none, which is nan in columns."""
    return value if isinstance(value, float) and not math.isnan(value) else None


@lru_cache(maxsize=1024)
def _ahead(
    network: Network, x: float, y: float, way: float | None, last: float | None, distance: float
) -> PolygonSet | Nowhere:
    """One object's stretch of lanes, which is asked for by all that may lie in it."""
    parts = ahead_in_lanes(network, x, y, way, last, distance)
    return PolygonSet(parts, "what lies ahead", network.roadDirection) if parts else Nowhere()


def fold(node: Node) -> Node:
    """The constant that a node amounts to if its children are constants and nothing about it is random."""
    below = children(node)
    if not below or not all(isinstance(child, Constant) for child in below):
        return node
    from_constants = cast("tuple[Constant, ...]", below)
    if is_leaf(node) or isinstance(node, DirectionAt | Among):
        return node
    return Constant(compute(node, tuple(child.value for child in from_constants)), span=node.span)
