"""Reading a value as what an operator needs: a scalar, a heading, a vector, a region (language paper, table 1)."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Generator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import wraps
from typing import cast

from scenicq.compiler.values import Choice, DelayedValue, Instance, ModelValue, describe, fail, is_node
from scenicq.errors import Span
from scenicq.forest.angle_wrap import any_turn
from scenicq.forest.build import compare, constant, vector
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import COURSE, GOING, LAST_LANE, CompareOp, Constant, Feature, Kind, Node, Select, Undefined
from scenicq.geometry.elements import NetworkElement
from scenicq.geometry.regions import Everywhere, Region
from scenicq.syntax.hints import condition_hint

__all__ = [
    "OBSERVABLE",
    "PARTIAL",
    "apart_from_height",
    "kind_of_model",
    "observed_property",
    "property_node",
    "read_over_time",
    "reads_over_time",
    "to_boolean",
    "to_field",
    "to_heading",
    "to_node",
    "to_place",
    "to_region",
    "to_scalar",
    "to_vector",
]

OBSERVABLE: dict[str, Kind] = {
    "position": "vector",
    "heading": "scalar",
    "width": "scalar",
    "length": "scalar",
    "height": "scalar",
    "speed": "scalar",
    "velocity": "vector",
    "angularSpeed": "scalar",
    "acceleration": "scalar",
    COURSE: "other",
    GOING: "other",
    LAST_LANE: "other",
}
"""Properties that a label can observe, by kind: references to them are conditioned on the label."""


PARTIAL = frozenset({"parentOrientation", "yaw"})
"""Properties that only make up the heading: not features of their own."""


_OVER_TIME: ContextVar[bool] = ContextVar("_OVER_TIME", default=False)
"""Whether properties are read at each sample: see `Feature.current`."""


@contextmanager
def read_over_time(*, current: bool = True) -> Generator[None]:
    """While a condition over time is evaluated: what it reads of objects is read at each sample.

    Args:
        current: Whether it is one: what makes objects within a run is not.
    """
    token = _OVER_TIME.set(current)
    try:
        yield
    finally:
        _OVER_TIME.reset(token)


def reads_over_time() -> bool:
    """Whether a condition over time is evaluated, or what a behavior or monitor does."""
    return _OVER_TIME.get()


def property_node(instance: Instance, name: str, span: Span | None) -> ModelValue:
    """The value of a property of an instance, by reference where a label may observe it."""
    value = instance.properties[name]
    if instance.index is None or name in PARTIAL:
        return value
    if name in OBSERVABLE:
        return observed_property(instance, name, OBSERVABLE[name], span)
    if is_node(value) and not isinstance(value, Constant):
        return observed_property(instance, name, kind_of(value), span)
    return value


def observed_property(instance: Instance, name: str, kind: Kind, span: Span | None) -> Feature:
    """A property of an object, by reference."""
    assert instance.index is not None
    return Feature(instance.index, name, kind, _OVER_TIME.get(), span=span)


def kind_of_model(value: ModelValue) -> Kind | None:
    """The kind of value that a program's value can be read as; None for lists, functions and the like."""
    if isinstance(value, bool):
        return "boolean"
    if isinstance(value, int | float):
        return "scalar"
    if is_node(value):
        return kind_of(cast(Node, value))
    if isinstance(value, NetworkElement):
        return "region"
    if isinstance(value, Choice):
        return kind_of_model(value.options[0])
    if isinstance(value, str) or value is None:
        return "other"
    return None


_VELOCITY = re.compile(r"(?<![\w.])([\w.]+)\.velocity\b")


def _need(value: ModelValue, what: str, span: Span | None) -> Exception:
    shown = describe(value)
    hints: tuple[str, ...] = ()
    if isinstance(value, tuple) and len(cast("tuple[ModelValue, ...]", value)) == 2 and "number" in what:
        hints = ("`Range(a, b)` is a random number from an interval; only Scenic 1 writes it `(a, b)` (`--scenic 1`)",)
    elif "number" in what and span is not None and (vector := _VELOCITY.search(span.text)):
        hints = (f"`{vector[1]}.speed` is a number",)
    elif what == "a condition" and span is not None and (hint := condition_hint(span.text.split(None, 1)[0])):
        hints = (hint,)
    elif isinstance(value, list | tuple) and any(kind_of_model(each) == "region" for each in value):
        hints = ("`Uniform(*elements)` chooses one of several",)
    elif isinstance(value, str) and what == "a vector field" and span is not None and " at " in span.text:
        hints = ("`at` after a value is the direction of a field there; a comma separates specifiers",)
    return fail("wrong-type", f"{what} is needed here, not {shown}", span, f"this is {shown}", hints)


def _of_each_option(
    read: Callable[[ModelValue, Span | None], Node],
) -> Callable[[ModelValue, Span | None], Node]:
    """A reading that takes a random choice, too, as one between what it reads of the options."""

    @wraps(read)
    def reading(value: ModelValue, span: Span | None) -> Node:
        if isinstance(value, Choice):
            return Select(value.index, tuple(reading(option, span) for option in value.options), span=span)
        return read(value, span)

    return reading


@_of_each_option
def to_node(value: ModelValue, span: Span | None) -> Node:
    """Any value that can be part of an expression."""
    assert not isinstance(value, DelayedValue)
    if is_node(value):
        return cast(Node, value)
    if isinstance(value, bool | int | float | str) or value is None:
        return constant(value, span)
    if isinstance(value, NetworkElement | Region):
        return to_region(value, span)
    if isinstance(value, tuple | list) and len(cast("list[ModelValue]", value)) in (2, 3):
        return to_vector(value, span)
    if isinstance(value, Instance):
        return to_vector(value, span)
    raise _need(value, "a number, vector, region or string", span)


@_of_each_option
def to_scalar(value: ModelValue, span: Span | None) -> Node:
    """A number; of truth values 1 is true and 0 is false, as in Python.

    Raises:
        ScenarioError: wrong-type.
    """
    if isinstance(value, int | float):
        if isinstance(value, int) and abs(value) > 2**1000:
            raise fail("wrong-value", "this number is too large", span)
        if not math.isfinite(value):
            raise fail("wrong-value", "this number is not finite", span)
        return constant(float(value), span)
    if is_node(value) and kind_of(cast(Node, value)) in ("scalar", "boolean"):
        return _number(cast(Node, value))
    raise _need(value, "a number", span)


def _number(node: Node) -> Node:
    """A number or truth value as a number."""
    if isinstance(node, Select):
        options = tuple(map(_number, node.options))
        same = all(one is other for one, other in zip(options, node.options, strict=True))
        return node if same else replace(node, options=options)
    if kind_of(node) != "boolean":
        return node
    if isinstance(node, Constant):
        return constant(float(cast(bool, node.value)), node.span)
    # a label may have anything in place of a truth value
    truth = compare(CompareOp.EQ, node, constant(True), node.span) if isinstance(node, Feature) else node
    return Select(truth, (constant(0.0, node.span), constant(1.0, node.span)), span=node.span)


@_of_each_option
def to_heading(value: ModelValue, span: Span | None) -> Node:
    """A heading in radians: a number, or the heading of an oriented point or object."""
    if isinstance(value, tuple) and len(cast("tuple[ModelValue, ...]", value)) == 3:
        if value[1:] != (0, 0):
            raise fail("unsupported-construct", "an orientation in space is not supported: labels are matched in 2D",
                       span, "three angles", ("write one angle, or make the second and third 0",))  # fmt: skip
        return to_scalar(value[0], span)
    if isinstance(value, Instance) and value.oriented:
        return to_scalar(property_node(value, "heading", span), span)
    if isinstance(value, Instance) or (is_node(value) and kind_of(cast(Node, value)) not in ("scalar", "boolean")):
        raise _need(value, "a heading", span)
    return any_turn(to_scalar(value, span))


@_of_each_option
def to_vector(value: ModelValue, span: Span | None) -> Node:
    """A vector: a vector, a pair of numbers, or the position of a point or object."""
    if isinstance(value, Instance):
        return to_vector(property_node(value, "position", span), span)
    if isinstance(value, tuple | list):
        parts = list(cast("tuple[ModelValue, ...]", value))
        if any(kind_of_model(each) == "region" for each in parts):
            raise _need(value, "a vector", span)
        flat = len(parts) == 3 and parts[2] in (0, 0.0)
        if len(parts) == 3 and not flat:
            raise fail("unsupported-construct", "a position with a height is not supported: labels are matched in 2D",
                       span, "three coordinates", ("write two coordinates, or make the third 0",))  # fmt: skip
        if len(parts) == 2 or flat:
            return vector(to_scalar(parts[0], span), to_scalar(parts[1], span), span)
    if is_node(value) and kind_of(cast(Node, value)) == "vector":
        return cast(Node, value)
    raise _need(value, "a vector", span)


def to_place(value: ModelValue, span: Span | None) -> Node:
    """Where an object is put: a vector without its height, since objects of the plane have none."""
    if isinstance(value, Instance):
        value = property_node(value, "position", span)
    flat, _ = apart_from_height(value)
    return to_vector(flat, span)


def apart_from_height(value: ModelValue) -> tuple[ModelValue, ModelValue]:
    """A vector of the plane, and the height of one that is written with three coordinates, else 0."""
    if isinstance(value, tuple | list) and len(parts := cast("list[ModelValue]", value)) == 3:
        return (parts[0], parts[1]), parts[2]
    return value, 0.0


def to_region(value: ModelValue, span: Span | None) -> Node:
    """A region: a region, or an element of the road network."""
    if value is None:
        return constant(Everywhere(), span)
    if isinstance(value, NetworkElement):
        return constant(value.region, span)
    if isinstance(value, Region):
        return constant(value, span)
    if is_node(value) and kind_of(value) == "region":
        return cast(Node, value)
    if isinstance(value, Choice):
        return Select(value.index, tuple(_option_region(option, value, span) for option in value.options), span=span)
    raise _need(value, "a region", span)


def _option_region(option: ModelValue, choice: Choice, span: Span | None) -> Node:
    """The region of one option; where others are elements of the map, None is a place in none and has no region."""
    if option is None and any(isinstance(other, NetworkElement) for other in choice.options):
        return constant(Undefined("there is no such element here"), span)
    return to_region(option, span)


def to_field(value: ModelValue, span: Span | None) -> Node:
    """A vector field."""
    if is_node(value) and kind_of(value) == "field":
        return cast(Node, value)
    raise _need(value, "a vector field", span)


@_of_each_option
def to_boolean(value: ModelValue, span: Span | None) -> Node:
    """A truth value."""
    if isinstance(value, bool):
        return constant(value, span)
    if is_node(value) and kind_of(value) in ("boolean", "scalar"):
        return cast(Node, value)
    if isinstance(value, int | float | str | list | tuple | dict) or value is None:
        return constant(bool(value), span)
    raise _need(value, "a condition", span)
