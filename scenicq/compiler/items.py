"""Items of lists, dictionaries, vectors and regions: `value[index]`, and what going through a vector gives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from scenicq.compiler import operators
from scenicq.compiler.arithmetic import check_hashable, is_random
from scenicq.compiler.coerce import kind_of_model, to_vector
from scenicq.compiler.comparisons import compare, iterate
from scenicq.compiler.courses import option_of
from scenicq.compiler.known_properties import known_truth
from scenicq.compiler.random_values import each_existing, regions_apart
from scenicq.compiler.region_attributes import corner
from scenicq.compiler.values import Choice, ModelValue, Module, describe, fail, is_node
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.geometry.elements import NetworkElement

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["components", "is_vector", "items_of", "length_of", "subscript"]


def length_of(value: ModelValue) -> int:
    """How many items going through a value costs; 0 for what has none."""
    return len(cast("list[ModelValue]", value)) if isinstance(value, str | list | tuple | dict | set | range) else 0


def is_vector(value: ModelValue) -> bool:
    """Whether a value is a vector rather than a pair of numbers."""
    return is_node(value) and kind_of_model(value) == "vector"


def components(run: Interpreter, vector: ModelValue, span: Span) -> tuple[ModelValue, ...]:
    """The coordinates of a vector, in Scenic 3 with its height."""
    plane = tuple(build.coordinate(to_vector(vector, span), axis, span) for axis in (0, 1))
    return (*plane, 0.0) if run.version == 3 else plane


def items_of(run: Interpreter, value: ModelValue, span: Span) -> list[ModelValue]:
    """The items of a known sequence or of a vector.

    Raises:
        ScenarioError: wrong-type or random-branch.
    """
    return list(components(run, value, span)) if is_vector(value) else iterate(option_of(run, value, span), span)


def _index_on_course(run: Interpreter, value: ModelValue, index: ModelValue, span: Span) -> ModelValue:
    """The index that the course takes among those that a value has.

    Raises:
        ScenarioError: map-lacks: it is none of them, which no scene has.
    """
    index = option_of(run, index, span)
    if kind_of_model(index) == "boolean":
        return known_truth(run, index, span)
    if not is_random(index):
        return index
    count = length_of(value)
    for each in list(cast("dict[ModelValue, ModelValue]", value)) if isinstance(value, dict) else range(-count, count):
        if known_truth(run, compare("==", index, each, span), span):
            return each
    raise fail("map-lacks", "there is no item with this random index", span, "not found")


def subscript(run: Interpreter, value: ModelValue, index: ModelValue, span: Span) -> ModelValue:
    """`value[index]`.

    Raises:
        ScenarioError: There is no such item, or the value has none.
    """
    value = value.names if isinstance(value, Module) and value.name == "globalParameters" else regions_apart(value)
    if isinstance(value, Choice):
        return each_existing(run, value, lambda option: subscript(run, option, index, span), span)
    if run.course is not None and is_random(index) and isinstance(value, list | tuple | dict | str | range):
        index = _index_on_course(run, value, index, span)
    if is_random(index) and isinstance(value, list | tuple):
        raise fail("unsupported-construct", "a random index is not supported", span, "random here",
                   ("use `Uniform(*list)` to pick one of the items",))  # fmt: skip
    if is_vector(value):
        value = components(run, value, span)
    if kind_of_model(value) == "region":
        return corner(value, index, span)
    if kind_of_model(value) == "field":
        return operators.direction_at(value, index, span)
    if isinstance(value, list | tuple | dict | str | range):
        if isinstance(value, dict):
            check_hashable(index, span)
        try:
            return cast(Any, value)[index]
        except (IndexError, KeyError, TypeError, ValueError):
            shown = f"`{index}`" if isinstance(index, int) or (isinstance(index, str) and len(index) <= 40) else "that"
            ids = isinstance(value, dict) and any(isinstance(item, NetworkElement) for item in value.values())
            hints = ("the identifiers are those of the dataset's map: choose an element by what it is like",)
            raise fail("map-lacks" if ids else "runtime-error", f"the map has no element {shown}" if ids else
                       f"there is no item {shown}", span, "not found", hints if ids else ()) from None  # fmt: skip
    raise fail("wrong-type", f"{describe(value)} has no items", span, "indexed here")
