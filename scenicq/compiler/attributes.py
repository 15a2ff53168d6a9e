"""Attribute access: what a program may read of each kind of value. Everything not listed does not exist."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

from scenicq.compiler import operators
from scenicq.compiler.arithmetic import check_hashable, check_weight, is_flat, is_random
from scenicq.compiler.coerce import property_node, to_heading, to_region, to_scalar, to_vector
from scenicq.compiler.coroutines import ScenarioCall, ScenarioNotBegunError
from scenicq.compiler.elements import MISSING, is_of_elements, names_of, of_element, of_network
from scenicq.compiler.following import follow
from scenicq.compiler.label_attributes import label_attribute
from scenicq.compiler.lookups import follow_link, look_up_of
from scenicq.compiler.random_values import each_existing, regions_apart
from scenicq.compiler.region_attributes import REGION_METHODS, holds_regions, of_region
from scenicq.compiler.suggestions import unknown_attribute
from scenicq.compiler.values import Builtin, Choice, Instance, ModelValue, Module, ScenicClass, describe, fail, is_node
from scenicq.errors import Diagnostic, Span
from scenicq.forest import build
from scenicq.forest.angle_wrap import one_turn
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import ArithmeticOp, Node
from scenicq.geometry.abstract_map import AbstractElement, NeedsMapError
from scenicq.geometry.elements import Maneuver, NetworkElement, Signal
from scenicq.geometry.network import Network
from scenicq.limits import LIMITS

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["PARTS", "attribute", "part_of"]

_PLAIN: dict[type, frozenset[str]] = {
    str: frozenset("lower upper strip lstrip rstrip split startswith endswith replace title isdigit join".split()),
    list: frozenset("append extend insert pop remove index count reverse copy clear sort".split()),
    dict: frozenset("get keys values items update pop setdefault copy".split()),
    set: frozenset("add discard remove union intersection difference update copy".split()),
    tuple: frozenset("index count".split()),
}
PARTS: dict[str, tuple[float, float]] = {
    "front": (0.0, 0.5),
    "back": (0.0, -0.5),
    "left": (-0.5, 0.0),
    "right": (0.5, 0.0),
    "front left": (-0.5, 0.5),
    "front right": (0.5, 0.5),
    "back left": (-0.5, -0.5),
    "back right": (0.5, -0.5),
}
_PART_NAMES = {"".join([part.split()[0], *(word.title() for word in part.split()[1:])]): part for part in PARTS}


def part_of(part: str, target: ModelValue, span: Span) -> Instance:
    """`front of O`, `back left of O` and so on: an oriented point on the box (language paper, table 5)."""
    if not (isinstance(target, Instance) and target.oriented):
        raise fail("wrong-type", f"`{part} of` needs an object", span, f"this is {describe(target)}")
    if part not in PARTS:
        raise fail("unsupported-construct", f"`{part} of` is not supported: labels are matched in 2D", span)
    right, ahead = PARTS[part]
    size = [to_scalar(property_node(target, name, span), span) for name in ("width", "length")]
    x, y = (
        cast(Node, operators.binary("*", side, part, span)) for side, part in zip(size, (right, ahead), strict=True)
    )
    offset = build.vector(x, y, span)
    heading = to_heading(target, span)
    return operators.make_oriented_point(build.offset_local(to_vector(target, span), heading, offset, span), heading)


def attribute(run: Interpreter, value: ModelValue, name: str, span: Span) -> ModelValue:
    """`value.name`.

    Raises:
        ScenarioError: unknown-attribute, or unsupported-construct for Python's own double-underscore names.
    """
    if name.startswith("__"):
        raise fail("unsupported-construct", f"`{name}` is not available to scenarios", span, "Python's own attribute",
                   ("scenarios are data: they never reach the Python interpreter",))  # fmt: skip
    if isinstance(value, Choice):
        if name in REGION_METHODS and holds_regions(value):
            return REGION_METHODS[name](to_region(value, span))
        if any(isinstance(option, AbstractElement) for option in value.options):
            return follow_link(run, value, name, span)
        return _of_choice(run, value, name, span)
    found = _lookup(run, value, name, span)
    if found is MISSING and isinstance(options := regions_apart(value), Choice):
        return _of_choice(run, options, name, span)
    if found is MISSING:
        if value is None and is_of_elements(name):
            raise fail("map-lacks", f"the map has no element here, so there is no `{name}`", span, "this is of None",
                       ("exclude places where there is none by a condition",))  # fmt: skip
        raise unknown_attribute(value, name, _names(run, value), _PLACES.get(name.lstrip("_"), ""), span)
    return found


def _of_choice(run: Interpreter, value: Choice, name: str, span: Span) -> ModelValue:
    """The attribute of each option; where there is none (in the map, or of None), that option has no scene."""
    return each_existing(run, value, lambda option: attribute(run, option, name, span), span)


def _names(run: Interpreter, value: ModelValue) -> set[str]:
    match value:
        case Instance():
            said = () if run.label_attributes is None else run.label_attributes()
            return {*value.properties, *_PART_NAMES, *said}
        case Module():
            return set(value.names)
        case Network() | NetworkElement() | Maneuver() | Signal():
            return names_of(value)
        case _:
            return set(_PLAIN.get(type(value), ()))


def _lookup(run: Interpreter, value: ModelValue, name: str, span: Span) -> ModelValue:
    match value:
        case AbstractElement():
            raise NeedsMapError
        case Instance():
            return _of_instance(run, value, name, span)
        case Module():
            return None if value.dynamic else value.names.get(name, MISSING)
        case ScenarioCall():
            names = run.begun(value)
            if names is None:
                raise ScenarioNotBegunError(
                    Diagnostic("runtime-error", f"the scenario has no `{name}` before it begins", span)
                )
            return names.get(name, MISSING)
        case ScenicClass():
            return next((cls.attributes[name] for cls in value.ancestry() if name in cls.attributes), MISSING)
        case Network():
            return of_network(run, value, name, span)
        case NetworkElement():
            region = of_region(build.constant(value.region, span), name, span)
            return of_element(run, value, name, span) if region is MISSING else region
        case Maneuver() | Signal():
            return of_element(run, value, name, span)
        case _ if is_node(value):
            return _of_field(run, value, name) if kind_of(value) == "field" else _of_node(value, name, span)
        case _ if name in _PLAIN.get(type(value), ()):
            return Builtin(name, _guarded(name, value), lifted=False, owner=value)
        case _:
            return MISSING


_SEARCHES = frozenset({"index", "count", "remove"})
_KEYED = frozenset({"get", "pop", "setdefault", "add", "discard"})


def _guarded(name: str, owner: ModelValue) -> Callable[..., ModelValue]:
    """A method of a string, list, dictionary or set, within bounds."""
    method: Callable[..., Any] = getattr(owner, name)

    def call(span: Span, *args: ModelValue, **named: ModelValue) -> ModelValue:
        if name in _SEARCHES and not isinstance(owner, str):
            if any(map(is_random, [*args, *cast("list[ModelValue]", owner)])):
                raise fail("random-branch", f"`{name}` cannot look for a random value", span, "random here")
            check_weight(span, owner, *args, compared=True)
        if name == "sort" and ("key" in named or not is_flat(owner)):
            raise fail("unsupported-construct", "`sort` of these values is not supported", span, "not plain values",
                       ("write `items = sorted(items, key=...)`",))  # fmt: skip
        if name == "join" and args and isinstance(args[0], str | list | tuple | dict | set):
            held = cast("list[ModelValue]", [*args[0]])
            _check_length(sum(len(owner) + len(each) for each in held if isinstance(each, str)), span)
        if isinstance(owner, dict | set) and name in _KEYED:
            args = (check_hashable(args[0], span), *args[1:]) if args else args
        if isinstance(owner, str) and name == "replace" and all(isinstance(arg, str) for arg in args[:2]):
            old, new = (*args, "", "")[:2]
            grown = owner.count(old) * max(len(new) - len(old), 0)
            _check_length(len(owner) + grown, span)
        try:
            result = method(*args, **named)
        except (ValueError, IndexError, KeyError):
            raise fail("runtime-error", f"`{name}` finds no such item", span, "failed here") from None
        for part in (owner, result):
            if isinstance(part, str | list | dict | set | tuple):
                _check_length(len(cast("list[ModelValue]", part)), span)
        return list(result) if type(result).__name__ in ("dict_keys", "dict_values", "dict_items") else result

    return call


def _check_length(length: int, span: Span) -> None:
    if length > LIMITS.value_items:
        raise fail("budget-exceeded", f"a value grows beyond {LIMITS.value_items:,} items", span, "grows here")


_PLACES = {
    "lane": "laneAt",
    "laneSection": "laneSectionAt",
    "laneGroup": "laneGroupAt",
    "road": "roadAt",
    "intersection": "intersectionAt",
    "crossing": "crossingAt",
    "element": "elementAt",
}


_OF_BOXES = frozenset({"containsPoint", "intersects"})
"""Methods of objects that are those of their boxes; from Scenic 3 on their distance is, too."""


def _of_instance(run: Interpreter, value: Instance, name: str, span: Span) -> ModelValue:
    if name in value.properties:
        found = property_node(value, name, span)
        turned = name == "heading" and run.version == 3 and is_node(found)
        return one_turn(cast(Node, found)) if turned else found
    if name == "orientation" and value.oriented:
        return to_heading(value, span)  # in the plane, it is the heading
    if name in _PART_NAMES and value.index is not None:
        return part_of(_PART_NAMES[name], value, span)
    if value.cls.derives_from("DrivingObject"):
        place = "laneGroup" if name == "oppositeLaneGroup" else name
        if place.lstrip("_") in _PLACES:
            found = look_up_of(run, value, _PLACES[place.lstrip("_")], not place.startswith("_"), span)
            return attribute(run, found, "opposite", span) if place is not name else found
    if name == "visibleRegion":
        return operators.visible_region(value, span)
    if name == "canSee":
        # what is given besides says what hides things, and here nothing does
        return Builtin(name, lambda span, other, *_, **__: operators.can_see(value, other, span))
    if value.index is not None and (name in _OF_BOXES or (name == "distanceTo" and run.version == 3)):
        return REGION_METHODS[name](operators.object_box(value, span))
    if name == "distanceTo":
        return Builtin(name, lambda span, other: operators.distance_to(other, value, span))
    if name == "angleTo":
        return Builtin(name, lambda span, other: operators.angle_to(other, value, span))
    if name == "corners":
        return _corners(value, span)
    for cls in value.cls.ancestry():
        if name in cls.attributes:
            return cls.attributes[name]
    found = _of_node(to_vector(value, span), name, span)
    return label_attribute(run, value, name, span) if found is MISSING else found


def _corners(value: Instance, span: Span) -> tuple[ModelValue, ...]:
    """The corners of the box, counter-clockwise from the front right: those of its top, then those of its bottom."""
    if value.index is None:
        return (to_vector(value, span),)
    around = ("front right", "front left", "back left", "back right")
    return 2 * tuple(part_of(part, value, span).properties["position"] for part in around)


def _of_field(run: Interpreter, value: Node, name: str) -> ModelValue:
    if name != "followFrom":
        return MISSING

    def follow_from(span: Span, start: ModelValue, distance: ModelValue) -> ModelValue:
        return follow(run, value, start, distance, span).properties["position"]

    return Builtin(name, follow_from)


def _angle_with(value: Node, other: Node, span: Span) -> Node:
    """How far a vector is turned from another, counter-clockwise."""
    return operators.relative_heading(build.bearing(other, span), build.bearing(value, span), span)


def _dot(value: Node, other: Node, span: Span) -> Node:
    """The scalar product."""
    along_x, along_y = (
        build.arithmetic(ArithmeticOp.MUL, build.coordinate(value, n), build.coordinate(other, n), span=span)
        for n in (0, 1)
    )
    return build.add(along_x, along_y, span)


def _of_node(value: Node, name: str, span: Span) -> ModelValue:
    match kind_of(value), name:
        case "vector", "x" | "y":
            return build.coordinate(value, "xy".index(name), span)
        case "vector", "z":
            return 0.0
        case "vector", "coords":
            # what `project` gives is a point of a geometry library, with a list of its coordinates
            return [(build.coordinate(value, 0, span), build.coordinate(value, 1, span))]
        case "vector", "normalized":
            one = build.arithmetic(ArithmeticOp.DIV, build.constant(1.0), build.norm(value, span), span=span)
            return Builtin(name, lambda span: build.scale(value, one, span))
        case "vector", "norm":
            return Builtin(name, lambda span: build.norm(value, span))
        case "vector", "distanceTo":
            return Builtin(name, lambda span, other: operators.distance_to(other, value, span))
        case "vector", "angleTo" | "azimuthTo":
            return Builtin(name, lambda span, other: operators.angle_to(other, value, span))
        case "vector", "angleWith":
            return Builtin(name, lambda span, other: _angle_with(value, to_vector(other, span), span))
        case "vector", "dot":
            return Builtin(name, lambda span, other: _dot(value, to_vector(other, span), span))
        case "vector", "rotatedBy":
            return Builtin(name, lambda span, angle: build.rotate(value, to_heading(angle, span), span))
        case "vector", "offsetRotated" | "offsetLocally":
            return Builtin(name, lambda span, turn, by: operators.along(value, to_heading(turn, span), by, span))
        case "vector", "offsetRadially":
            return Builtin(name, lambda span, by, turn: operators.along(value, to_heading(turn, span), (0, by), span))
        case "region", _:
            return of_region(value, name, span)
        case _:
            return MISSING
