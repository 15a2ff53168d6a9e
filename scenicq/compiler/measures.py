"""Measures of the field in `scenicq.labels`: time to collision, time headway, post-encroachment time and their like.

Those of one instant are expressions over what labels observe of both objects, so that all that reads expressions reads
them; those of how tracks go on are asked of their courses (`scenicq.geometry.measures`). Definitions, units and
sources stand in `tests/language/measures.md`, and in `scenicq.labels` for real Scenic.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import TYPE_CHECKING

from scenicq.compiler.coerce import property_node, to_heading, to_scalar, to_vector
from scenicq.compiler.operators import object_box
from scenicq.compiler.road_courses import along, course_of
from scenicq.compiler.values import Instance, ModelValue, describe, fail
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import (
    ArithmeticOp,
    CompareOp,
    Constant,
    Distance,
    Intersects,
    LogicOp,
    Measure,
    Node,
    Select,
)
from scenicq.geometry.measures import NEVER, STANDING_MPS

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = [
    "between_boxes",
    "box_distance",
    "course_change",
    "deceleration_to_avoid",
    "hides",
    "jerk",
    "post_encroachment_time",
    "time_headway",
    "time_to_collision",
]

_LINE_M = 1e-6
"""How wide a line of sight is."""
_ZERO, _HALF, _TWO, _NEVER = (build.constant(value) for value in (0.0, 0.5, 2.0, NEVER))


def time_to_collision(_run: Interpreter, span: Span, one: ModelValue, other: ModelValue) -> Node:
    """Seconds until the boxes of two objects touch if both go on with their velocities, without turning."""
    seen = [_Seen(each, "time_to_collision", span) for each in (one, other)]
    parts = [part for o in seen for part in (o.position, o.heading, o.velocity, o.width, o.length)]
    return Measure("time_to_collision", tuple(parts), span=span)


def time_headway(run: Interpreter, span: Span, one: ModelValue, other: ModelValue) -> Node:
    """Seconds until the front of an object is where that of another is now, along its course at its speed."""
    a, b = (_Seen(each, "time_headway", span) for each in (one, other))
    way = build.add(along(run, span, one, other), _times(_HALF, build.minus(b.length, a.length)))
    comes = build.logic(
        LogicOp.AND, build.compare(CompareOp.GE, way, _ZERO),
        build.compare(CompareOp.GT, a.speed, build.constant(STANDING_MPS)), span=span,
    )  # fmt: skip
    until = _extreme(ArithmeticOp.MIN, [build.arithmetic(ArithmeticOp.DIV, way, a.speed), _NEVER])
    return Select(comes, (_NEVER, until), span=span)


def deceleration_to_avoid(run: Interpreter, span: Span, one: ModelValue, other: ModelValue) -> Node:
    """The constant deceleration with which an object just does not hit another that drives ahead on its course."""
    a, b = (_Seen(each, "deceleration_to_avoid", span) for each in (one, other))
    way = along(run, span, one, other)
    gap = build.minus(way, _times(_HALF, build.add(a.length, b.length)))
    closing = build.minus(a.speed, b.speed)
    needed = build.logic(
        LogicOp.AND, build.compare(CompareOp.GT, way, _ZERO), build.compare(CompareOp.GT, closing, _ZERO), span=span
    )
    amount = build.arithmetic(ArithmeticOp.DIV, _times(closing, closing), _times(_TWO, gap))
    some = build.compare(CompareOp.GT, gap, build.constant(STANDING_MPS))
    avoided = Select(some, (_NEVER, _extreme(ArithmeticOp.MIN, [amount, _NEVER])), span=span)
    return Select(needed, (_ZERO, avoided), span=span)


def box_distance(_run: Interpreter, span: Span, one: ModelValue, other: ModelValue) -> Node:
    """Metres between the boxes of two objects; 0 where they touch."""
    return between_boxes(one, other, span, "box_distance")


def between_boxes(one: ModelValue, other: ModelValue, span: Span, name: str) -> Node:
    """As `box_distance`, by the name by which it is asked for."""
    boxes = [_Seen(each, name, span) for each in (one, other)]
    areas = [object_box(each.instance, span) for each in boxes]
    ways = [
        Distance(area, corner, span=span)
        for area, far in zip(areas, reversed(boxes), strict=True)
        for corner in far.corners()
    ]
    return Select(Intersects(*areas, span=span), (_extreme(ArithmeticOp.MIN, ways), _ZERO), span=span)


def hides(
    run: Interpreter, span: Span, screen: ModelValue, thing: ModelValue, viewer: ModelValue = None, *,
    whole: ModelValue = False,
) -> Node:  # fmt: skip
    """Whether the box of an object covers the line from a viewer to the centre of another, or to all of its box."""
    if not isinstance(whole, bool):
        raise fail("wrong-type", "`whole` is True or False", span, f"this is {describe(whole)}")
    seer = run.ego(span) if viewer is None else viewer
    cover, target, eye = (_Seen(each, "hides", span) for each in (screen, thing, seer))
    area = object_box(cover.instance, span)
    # what lies behind a box is convex, so that the corners tell of all of another
    ends = target.corners() if whole else [target.position]
    covered = [Intersects(area, _line(eye.position, end, span), span=span) for end in ends]
    return covered[0] if len(covered) == 1 else build.logic(LogicOp.AND, *covered, span=span)


def _line(start: Node, end: Node, span: Span) -> Node:
    """A line between two points, as a box that is hardly wide."""
    way = build.vector_difference(end, start)
    middle = build.vector_sum(start, build.scale(way, _HALF))
    return build.box(middle, build.bearing(way), build.constant(_LINE_M), build.norm(way), span)


def jerk(run: Interpreter, span: Span, owner: ModelValue) -> Node:
    """The slope of the acceleration of an object, metres per second cubed."""
    return Measure("jerk", (course_of(run, owner, "jerk", span),), span=span)


def course_change(run: Interpreter, span: Span, owner: ModelValue, seconds: ModelValue) -> Node:
    """How far the course of an object turns to the left in the next seconds, radians."""
    number = seconds.value if isinstance(seconds, Constant) else seconds
    if isinstance(number, bool) or not isinstance(number, int | float) or not 0 < number < 1e6:
        raise fail("wrong-value", "`course_change` needs a known number of seconds, which is positive", span,
                   f"this is {number if isinstance(number, int | float) else describe(seconds)}")  # fmt: skip
    return Measure(
        "course_change", (course_of(run, owner, "course_change", span),), float(number), span=span
    )  # fmt: skip


def post_encroachment_time(run: Interpreter, span: Span, one: ModelValue, other: ModelValue) -> Node:
    """Seconds between the one object and the other at a place that both cover, the least of all places."""
    courses = tuple(course_of(run, each, "post_encroachment_time", span) for each in (one, other))
    return Measure("post_encroachment_time", courses, span=span)


class _Seen:
    """What labels observe of an object."""

    def __init__(self, value: ModelValue, name: str, span: Span) -> None:
        if not isinstance(value, Instance) or value.index is None:
            raise fail("wrong-type", f"`{name}` is about objects", span, f"this is {describe(value)}",
                       ("name an object, such as `ego`",))  # fmt: skip
        self.instance, self._span = value, span
        self.position, self.heading = to_vector(value, span), to_heading(value, span)

    @property
    def velocity(self) -> Node:
        return to_vector(property_node(self.instance, "velocity", self._span), self._span)

    @property
    def speed(self) -> Node:
        return self._number("speed")

    @property
    def width(self) -> Node:
        return self._number("width")

    @property
    def length(self) -> Node:
        return self._number("length")

    def _number(self, name: str) -> Node:
        return to_scalar(property_node(self.instance, name, self._span), self._span)

    def corners(self) -> list[Node]:
        halves = [_times(_HALF, each) for each in (self.width, self.length)]
        other = [build.arithmetic(ArithmeticOp.NEG, each) for each in halves]
        return [
            build.offset_local(self.position, self.heading, build.vector(x, y))
            for x in (halves[0], other[0])
            for y in (halves[1], other[1])
        ]


def _times(left: Node, right: Node) -> Node:
    return build.arithmetic(ArithmeticOp.MUL, left, right)


def _extreme(op: ArithmeticOp, nodes: Sequence[Node]) -> Node:
    return reduce(lambda one, other: build.arithmetic(op, one, other), nodes)
