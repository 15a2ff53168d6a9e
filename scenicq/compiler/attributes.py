"""Attribute access: what a program may read of each kind of value. Everything not listed does not exist."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches
from typing import Any, cast

from scenicq.compiler import operators
from scenicq.compiler.builtins import LARGEST
from scenicq.compiler.coerce import property_node, to_heading, to_scalar, to_vector
from scenicq.compiler.values import Builtin, Choice, Instance, ModelValue, Module, ScenicClass, describe, fail, is_node
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import Constant, Node
from scenicq.geometry.elements import Maneuver, MissingElementError, NetworkElement
from scenicq.geometry.fields import VectorField
from scenicq.geometry.network import Network
from scenicq.geometry.regions import Region

__all__ = ["attribute", "part_of"]

_PLAIN: dict[type, frozenset[str]] = {
    str: frozenset("lower upper strip lstrip rstrip split startswith endswith replace title capitalize isdigit".split()),
    list: frozenset("append extend insert pop remove index count reverse copy clear".split()),
    dict: frozenset("get keys values items update pop setdefault copy".split()),
    set: frozenset("add discard remove union intersection difference update copy".split()),
    tuple: frozenset("index count".split()),
}
_ELEMENT_HIDDEN = frozenset({"polygon", "properties"})
_NETWORK = frozenset(
    "lanes laneSections laneGroups roads connectingRoads allRoads intersections crossings sidewalks shoulders "
    "laneRegion roadRegion intersectionRegion crossingRegion sidewalkRegion shoulderRegion drivableRegion "
    "walkableRegion curbRegion roadDirection".split()
)
_LOOKUPS = frozenset("laneAt laneSectionAt laneGroupAt roadAt intersectionAt crossingAt sidewalkAt elementAt".split())
_PARTS: dict[str, tuple[float, float]] = {
    "front": (0.0, 0.5),
    "back": (0.0, -0.5),
    "left": (-0.5, 0.0),
    "right": (0.5, 0.0),
    "front left": (-0.5, 0.5),
    "front right": (0.5, 0.5),
    "back left": (-0.5, -0.5),
    "back right": (0.5, -0.5),
}
_PART_NAMES = {"".join([part.split()[0], *(word.title() for word in part.split()[1:])]): part for part in _PARTS}


def part_of(part: str, target: ModelValue, span: Span) -> Instance:
    """`front of O`, `back left of O` and so on: an oriented point on the box (language paper, table 5)."""
    if not (isinstance(target, Instance) and target.oriented):
        raise fail("wrong-type", f"`{part} of` needs an object", span, f"this is {describe(target)}")
    if part not in _PARTS:
        raise fail("unsupported-construct", f"`{part} of` is not supported: labels are matched in 2D", span)
    right, ahead = _PARTS[part]
    size = [to_scalar(property_node(target, name, span), span) for name in ("width", "length")]
    offset = build.vector(
        cast(Node, operators.binary("*", size[0], right, span)), cast(Node, operators.binary("*", size[1], ahead, span)), span
    )
    heading = to_heading(target, span)
    return operators.oriented(build.offset_local(to_vector(target, span), heading, offset, span), heading)


def attribute(value: ModelValue, name: str, span: Span) -> ModelValue:
    """`value.name`.

    Raises:
        ScenarioError: unknown-attribute, or unsupported-construct for Python's own double-underscore names.
    """
    if name.startswith("__"):
        raise fail("unsupported-construct", f"`{name}` is not available to scenarios", span, "Python's own attribute",
                   ("scenarios are data: they never reach the Python interpreter",))  # fmt: skip
    found = _lookup(value, name, span)
    if found is _MISSING:
        close = get_close_matches(name, sorted(_names(value)), 1, 0.7)
        hints = (f"`{close[0]}` is an attribute with a similar name",) if close else ()
        shown = f"a {kind_of(value)}" if is_node(value) else describe(value)
        raise fail("unknown-attribute", f"{shown} has no attribute `{name}`", span, "not found", hints)
    return found


_MISSING = object()


def _names(value: ModelValue) -> set[str]:
    match value:
        case Instance():
            return set(value.properties) | set(_PART_NAMES)
        case Module():
            return set(value.names)
        case Network():
            return set(_NETWORK | _LOOKUPS)
        case NetworkElement() | Maneuver():
            return {name for name in dir(value) if not name.startswith("__")} - _ELEMENT_HIDDEN
        case _:
            return set(_PLAIN.get(type(value), ()))


def _lookup(value: ModelValue, name: str, span: Span) -> ModelValue:  # noqa: PLR0911
    match value:
        case Instance():
            return _of_instance(value, name, span)
        case Module():
            return value.names.get(name, _MISSING)
        case ScenicClass():
            return next((cls.attributes[name] for cls in value.ancestry() if name in cls.attributes), _MISSING)
        case Network():
            return _of_network(value, name)
        case NetworkElement():
            region = _of_region(build.constant(value.region, span), name)
            return _of_element(value, name, span) if region is _MISSING else region
        case Maneuver():
            return _of_element(value, name, span)
        case Choice():
            return operators.make_choice(value.index, [attribute(option, name, span) for option in value.options], span)
        case _ if is_node(value):
            return _of_node(value, name, span)
        case _ if name in _PLAIN.get(type(value), ()):
            return Builtin(name, _guarded(getattr(value, name)), lifted=False)
        case _:
            return _MISSING


def _guarded(method: Callable[..., Any]) -> Callable[..., ModelValue]:
    def call(span: Span, *args: ModelValue, **named: ModelValue) -> ModelValue:
        try:
            result = method(*args, **named)
        except (ValueError, TypeError, IndexError, KeyError) as error:
            raise fail("runtime-error", f"`{method.__name__}` failed: {error}", span) from None
        owner = getattr(method, "__self__", None)
        size = max(len(part) for part in (owner, result, "") if isinstance(part, str | list | dict | set | tuple))
        if size > LARGEST:
            raise fail("budget-exceeded", f"a value grows beyond {LARGEST:,} items", span)
        return list(result) if type(result).__name__ in ("dict_keys", "dict_values", "dict_items") else result

    return call


def _of_instance(value: Instance, name: str, span: Span) -> ModelValue:
    if name in value.properties:
        return property_node(value, name, span)
    if name in _PART_NAMES and value.index is not None:
        return part_of(_PART_NAMES[name], value, span)
    if name == "visibleRegion":
        return operators.visible_region(value, span)
    return next((cls.attributes[name] for cls in value.cls.ancestry() if name in cls.attributes), _MISSING)


def _of_network(network: Network, name: str) -> ModelValue:
    if name in _LOOKUPS:

        def look_up(span: Span, point: ModelValue, **_: ModelValue) -> ModelValue:
            where = to_vector(point, span)
            if not isinstance(where, Constant):
                raise fail("unsupported-construct", f"`network.{name}` of a random point is not supported", span,
                           "a random point", ("state the relation with `in` and a region",))  # fmt: skip
            return getattr(network, name)(*cast("tuple[float, float]", where.value))

        return Builtin(name, look_up)
    if name not in _NETWORK:
        return _MISSING
    found = getattr(network, name)
    return build.constant(found) if name.endswith("Region") or name == "roadDirection" else found


def _of_element(value: NetworkElement | Maneuver, name: str, span: Span) -> ModelValue:
    if name in _ELEMENT_HIDDEN or not hasattr(type(value), name) and name not in value.__dict__:
        return _MISSING
    try:
        found = getattr(value, name)
    except MissingElementError as error:
        raise fail("map-lacks", str(error), span, "not in this map",
                   (f"test `_{name}` against None first",)) from None  # fmt: skip
    if callable(found):
        return _MISSING
    return build.constant(found, span) if isinstance(found, Region | VectorField) else found


def _of_node(value: Node, name: str, span: Span) -> ModelValue:
    match kind_of(value), name:
        case "vector", "x" | "y":
            return build.coordinate(value, "xy".index(name), span)
        case "vector", "z":
            return 0.0
        case "vector", "norm":
            return Builtin(name, lambda span: build.norm(value, span))
        case "vector", "distanceTo":
            return Builtin(name, lambda span, other: operators.distance_to(other, value, span))
        case "vector", "angleTo":
            return Builtin(name, lambda span, other: operators.angle_to(other, value, span))
        case "vector", "rotatedBy":
            return Builtin(name, lambda span, angle: build.rotate(value, to_heading(angle, span), span))
        case "region", _:
            return _of_region(value, name)
        case _:
            return _MISSING


def _of_region(value: Node, name: str) -> ModelValue:
    match name:
        case "union":
            return Builtin(name, lambda span, other: operators.region_union(value, other, span))
        case "intersect":
            return Builtin(name, lambda span, other: operators.region_intersection(value, other, span))
        case "difference":
            return Builtin(name, lambda span, other: operators.region_difference(value, other, span))
        case "containsPoint":
            return Builtin(name, lambda span, point: operators.within(to_vector(point, span), value, span))
        case _:
            return _MISSING
