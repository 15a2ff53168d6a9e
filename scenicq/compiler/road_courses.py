"""`along`, `beside`, `course` and `corridor` of `scenicq.labels`: the course that an object drives, and who is where.

What they mean is in `scenicq.geometry.driven_courses`. A course is a property of its object that labels observe, by the
track of the label object; where nothing but one label is known, and in scenes that are drawn, it is that of the lane.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenicq.compiler.coerce import property_node, to_heading, to_node, to_vector
from scenicq.compiler.values import Instance, ModelValue, describe, fail, is_node
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import COURSE, Constant, Corridor, CourseCoordinate, LaneCourse, Node
from scenicq.forest.walk import leaves

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["along", "beside", "corridor", "course", "course_of"]


def along(run: Interpreter, span: Span, owner: ModelValue, place: ModelValue) -> CourseCoordinate:
    """How far ahead of an object a place is on the object's course, in metres; behind it negative."""
    return CourseCoordinate(course_of(run, owner, "along", span), _known_place(place, "along", span), 0, span=span)


def beside(run: Interpreter, span: Span, owner: ModelValue, place: ModelValue) -> Node:
    """How far to the left of an object's course a place is, in metres; to the right negative."""
    return CourseCoordinate(course_of(run, owner, "beside", span), _known_place(place, "beside", span), 1, span=span)


def course(run: Interpreter, span: Span, owner: ModelValue) -> Node:
    """The course of an object as a region: a line, as that in the middle of a lane."""
    return Corridor(course_of(run, owner, "course", span), build.constant(0.0), span=span)


def corridor(run: Interpreter, span: Span, owner: ModelValue, half_width: ModelValue) -> Node:
    """What lies within so many metres of an object's course."""
    number = half_width.value if isinstance(half_width, Constant) else half_width
    if isinstance(number, bool) or not isinstance(number, int | float) or not 0 < number < 1e6:
        raise fail("wrong-value", "`corridor` needs a known number of metres, which is positive", span,
                   f"this is {number if isinstance(number, int | float) else describe(half_width)}")  # fmt: skip
    return Corridor(course_of(run, owner, "corridor", span), build.constant(float(number)), span=span)


def course_of(run: Interpreter, owner: ModelValue, name: str, span: Span) -> Node:
    """The course of an object.

    Raises:
        ScenarioError: wrong-type: it is no object.
    """
    if not isinstance(owner, Instance) or owner.index is None:
        shown = f"a hidden `{owner.cls.name}`" if isinstance(owner, Instance) else _described(owner)
        raise fail("wrong-type", f"{shown} has no course: `{name}` asks for that of an object", span,
                   "no object here", ("name an object, such as `ego`",))  # fmt: skip
    if COURSE not in owner.properties:
        here, faces = to_vector(owner, span), to_heading(owner, span)
        owner.properties[COURSE] = LaneCourse(here, faces, run.network, run.gap_s, span=span)
    if owner.index < 0:
        # the courses of label objects without a role are made as that of the ego is
        course_of(run, run.ego(span), name, span)
    return to_node(property_node(owner, COURSE, span), span)


def _known_place(place: ModelValue, name: str, span: Span) -> Node:
    """A place that a label tells.

    Raises:
        ScenarioError: wrong-type: it is none, or hidden.
    """
    node = to_vector(place, span)
    if leaves(node):
        shown = f"a hidden `{place.cls.name}`" if isinstance(place, Instance) else "a random point"
        raise fail("unsupported-construct", f"`{name}` needs a place that labels show, not {shown}", span,
                   "hidden here", ("name an object, as in `new Car`, and ask for that",))  # fmt: skip
    return node


def _described(value: ModelValue) -> str:
    if is_node(value):
        return f"a {kind_of(value)}"
    return describe(value)
