"""What each specifier of the language means (language paper, appendix B.3; Scenic 3's changes in its 2D mode)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import cast

from scenicq.compiler import operators
from scenicq.compiler.coerce import kind_of_model, property_node, to_heading, to_place, to_scalar, to_vector
from scenicq.compiler.deviations import DEVIATIONS, deviation, leaves_the_plane
from scenicq.compiler.environment import FIRST_NAMES, Budget
from scenicq.compiler.following import follow
from scenicq.compiler.operations import values_of
from scenicq.compiler.orientations import orientation, surely_gives_a_heading
from scenicq.compiler.random_values import holds_instances, lift, make_choice, to_common_type
from scenicq.compiler.specifiers import BoundSpecifier
from scenicq.compiler.values import Choice, DelayedValue, Instance, ModelValue, fail
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.compute import fold
from scenicq.forest.nodes import Constant, Feature, Index, Node, PointIn, RegionDifference, Select
from scenicq.forest.value_numbers import ValueNumbers
from scenicq.geometry.network import Network
from scenicq.syntax import ast
from scenicq.syntax.phrases import SPECIFIERS, PhraseRow, each_meaning

__all__ = ["SpecifierContext", "bind"]

_NOWHERE = build.bearing(build.constant((0.0, 0.0)))
"""The heading of a line of no length."""

Evaluate = Callable[[ast.Expression], ModelValue]


@dataclass(slots=True, eq=False)
class SpecifierContext:
    """What specifiers refer to besides their arguments.

    Attributes:
        version: The version of Scenic.
        ego: Gives the ego, or fails where there is none yet.
        workspace: The workspace's region.
        budget: What the program may still use.
        network: The road network.
        may_lack: Whether some option of the choice with an index lacks a part that the program asked for.
        is_object: Whether an object, rather than a point, is being placed.
    """

    version: int
    ego: Callable[[Span], Instance]
    workspace: Callable[[], Node]
    budget: Budget
    network: Network
    may_lack: Callable[[Node], bool]
    is_object: bool


def _specifier(
    span: Span,
    gives: str,
    evaluate: Callable[[Instance], Mapping[str, ModelValue]],
    *arguments: ModelValue,
    optionally: str = "",
    needs: str = "",
    rank: int = 3,
    modifies: str = "",
    condition: Callable[[Instance], Node] | None = None,
) -> BoundSpecifier:
    delayed = frozenset[str]().union(*(argument.needs for argument in arguments if isinstance(argument, DelayedValue)))
    return BoundSpecifier(
        frozenset(gives.split()), frozenset(optionally.split()), frozenset(needs.split()) | delayed, evaluate, span,
        rank=rank, modifies=modifies, condition=condition,
    )  # fmt: skip


def _known(value: ModelValue, instance: Instance) -> ModelValue:
    while isinstance(value, DelayedValue):
        value = value.evaluate(instance)
    return value


def _flat(value: ModelValue, span: Span, *, is_object: bool) -> Node:
    """A vector of the plane; that of an object may be written with a height, which is left out."""
    return to_place(value, span) if is_object else to_vector(value, span)


def _position(span: Span, value: ModelValue, heading: ModelValue = None) -> BoundSpecifier:
    """A specifier of a position and, if there is one, optionally of a heading."""

    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        place = _known(value, instance)
        given: dict[str, ModelValue] = {"position": _flat(place, span, is_object=instance.index is not None)}
        if heading is not None:
            given["heading"] = heading
        return given

    return _specifier(span, "position", evaluate, value, optionally="heading" if heading is not None else "")


def _inherited(origin: ModelValue, around: SpecifierContext, span: Span) -> ModelValue:
    """The heading that Scenic 3 takes over from an oriented origin; Scenic 1 and 2 take none."""
    if around.version < 3 or not (isinstance(origin, Instance) and origin.oriented):
        return None
    return to_heading(origin, span)


def _own_position(instance: Instance, position: Node, span: Span) -> Node:
    """The position that an optional heading is taken at: by reference for an object, which a label observes."""
    return position if instance.index is None else Feature(instance.index, "position", "vector", span=span)


def _in_region(
    around: SpecifierContext, span: Span, region: ModelValue, *, contained: bool = False, modifies: bool = False
) -> BoundSpecifier:
    on_object = isinstance(region, Instance) and region.index is not None and around.version == 3
    area = operators.object_box(region, span) if on_object else operators.existing(region, span)
    point = PointIn(area, span=span)
    has_heading = on_object or orientation(area, point, span) is not None

    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        given: dict[str, ModelValue] = {"position": point, "regionContainedIn": area}
        if has_heading:
            given["heading"] = 0.0 if on_object else orientation(area, _own_position(instance, point, span), span)
        return given

    def inside(instance: Instance) -> Node:
        return operators.within(property_node(instance, "position", span), area, span)

    gives = "position regionContainedIn" if contained else "position"
    optional = "heading" if has_heading else ""
    perhaps = has_heading and not surely_gives_a_heading(area, around.may_lack)
    if not modifies:
        return replace(_specifier(span, gives, evaluate, optionally=optional), perhaps=perhaps)
    # in the plane, projecting a position that is given otherwise onto a region is to demand that it lies there
    bound = _specifier(span, gives, evaluate, optionally=optional, rank=2, modifies="position", condition=inside)
    return replace(bound, perhaps=perhaps)


def _beside(
    right: int, ahead: int, around: SpecifierContext, span: Span, reference: ModelValue, by: ModelValue
) -> BoundSpecifier:
    """`left of X by D` and its like: from the edge of X's box to the edge of the object's own."""
    size = "width" if right else "length"

    def gap(away: ModelValue, instance: Instance) -> tuple[Node, Node]:
        zero = build.constant(0.0)
        if kind_of_model(away) == "vector" or isinstance(away, tuple | list):
            pair = _flat(away, span, is_object=instance.index is not None)
            x, y = build.coordinate(pair, 0, span), build.coordinate(pair, 1, span)
        else:
            distance = to_scalar(0.0 if away is None else away, span)
            x, y = (distance, zero) if right else (zero, distance)
        if right + ahead > 0:
            return x, y
        # the part of the offset that points away from the edge counts outwards
        inward = cast(Node, operators.negate(x if right else y, span))
        return (inward, y) if right else (x, inward)

    def half(instance: Instance) -> Node:
        factor = build.constant(0.5 * (right + ahead))
        return build.arithmetic(
            operators.ArithmeticOp.MUL, to_scalar(property_node(instance, size, span), span), factor, span=span
        )

    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        x, y = gap(_known(by, instance), instance)
        edge = half(instance)
        if isinstance(reference, Instance) and reference.index is not None:
            edge = build.add(edge, half(reference), span)
        x, y = (build.add(x, edge, span), y) if right else (x, build.add(y, edge, span))
        oriented = isinstance(reference, Instance) and reference.oriented
        heading = to_heading(reference if oriented else property_node(instance, "heading", span), span)
        position = build.offset_local(to_vector(reference, span), heading, build.vector(x, y, span), span)
        return {"position": position, "heading": heading} if oriented else {"position": position}

    oriented = isinstance(reference, Instance) and reference.oriented
    needs = size if oriented else f"{size} heading"
    return _specifier(span, "position", evaluate, by, optionally="heading" if oriented else "", needs=needs)


def _visible(hidden: bool, around: SpecifierContext, span: Span, viewer: ModelValue) -> BoundSpecifier:
    """`visible`, `not visible`: up to Scenic 2 about the position; in 3 also about the object, however placed."""
    seen = operators.visible_region(viewer, span)
    if around.version < 3:
        whole = around.workspace()
        return _in_region(around, span, fold(RegionDifference(whole, seen, span=span)) if hidden
                          else operators.region_intersection(seen, whole, span))  # fmt: skip

    def place(instance: Instance) -> Mapping[str, ModelValue]:
        if not hidden:
            return {"position": PointIn(seen, span=span)}
        within = instance.properties.get("regionContainedIn")
        area = around.workspace() if within is None else operators.existing(within, span)
        return {"position": PointIn(operators.region_difference(area, seen, span), span=span)}

    def condition(instance: Instance) -> Node:
        sight = operators.can_see(viewer, instance, span)
        return cast(Node, operators.combine("not", [sight], span)) if hidden else sight

    needs = "regionContainedIn" if hidden and around.is_object else ""
    return _specifier(span, "", place, optionally="position", needs=needs, condition=condition)


def _beyond(
    around: SpecifierContext, span: Span, target: ModelValue, by: ModelValue, origin: ModelValue
) -> BoundSpecifier:
    goal = to_vector(target, span)
    sight = build.bearing(build.vector_difference(goal, to_vector(origin, span), span), span)
    is_vector = kind_of_model(by) == "vector" or isinstance(by, tuple | list)
    is_object = around.is_object
    offset = (
        _flat(by, span, is_object=is_object)
        if is_vector
        else build.vector(build.constant(0.0), to_scalar(by, span), span)
    )
    position = build.offset_local(goal, sight, offset, span)
    if around.version < 3:
        return _position(span, position)
    # Scenic 3's manual says the origin's orientation, Scenic 3.1 itself takes the map's axes: either is a match
    axes, inherited = build.constant(0.0), _inherited(origin, around, span)
    return _position(span, position, axes if inherited is None else _either(axes, inherited, span))


def _either(one: ModelValue, other: ModelValue, span: Span) -> Node:
    """A heading that may be either of two, where Scenic and its manual or the papers differ."""
    return Select(Index((1.0, 1.0), span=span), (to_heading(one, span), to_heading(other, span)), span=span)


def _following(
    around: SpecifierContext, span: Span, field: ModelValue, start: ModelValue, length: ModelValue
) -> BoundSpecifier:
    position = follow(around, field, start, length, span).properties["position"]

    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        here = _own_position(instance, position, span)
        return {"position": position, "heading": operators.direction_at(field, here, span)}

    return _specifier(span, "position", evaluate, optionally="heading")


def _facing(around: SpecifierContext, span: Span, value: ModelValue) -> BoundSpecifier:
    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        heading = _known(value, instance)
        if operators.is_field(heading):
            return {"heading": operators.direction_at(heading, property_node(instance, "position", span), span)}
        return {"heading": to_heading(heading, span)}

    needs = "position" if operators.is_field(value) else ""
    return _specifier(span, "heading", evaluate, value, needs=needs)


def _facing_point(away: bool, around: SpecifierContext, span: Span, target: ModelValue) -> BoundSpecifier:
    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        own, goal = (
            to_vector(property_node(instance, "position", span), span),
            to_vector(_known(target, instance), span),
        )
        line = build.vector_difference(own, goal, span) if away else build.vector_difference(goal, own, span)
        sight = build.bearing(line, span)
        if around.version < 3 or not _is_same(to_vector(instance.properties["position"], span), goal):
            return {"heading": sight}
        # Scenic 3 turns the line by the parent's orientation and the heading back, which a line of no length shows
        return {"heading": build.add(to_heading(instance.properties["parentOrientation"], span), _NOWHERE, span)}

    needs = "position" if around.version < 3 else "position parentOrientation"
    return _specifier(span, "heading", evaluate, target, needs=needs)


def _is_same(one: Node, other: Node) -> bool:
    numbers = ValueNumbers()
    return numbers.expression(one) == numbers.expression(other)


def _apparently(around: SpecifierContext, span: Span, heading: ModelValue, origin: ModelValue) -> BoundSpecifier:
    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        own = to_vector(property_node(instance, "position", span), span)
        line = build.vector_difference(own, to_vector(origin, span), span)
        seen = build.add(to_heading(_known(heading, instance), span), build.bearing(line, span), span)
        if around.version < 3:
            return {"heading": seen}
        # the papers and Scenic 3's manual mean the line of sight alone, Scenic 3.1 adds to it: either is a match
        parent = to_heading(instance.properties["parentOrientation"], span)
        added = build.add(parent, seen, span)
        plain = isinstance(parent, Constant) and parent.value == 0.0
        return {"heading": seen if plain else _either(seen, added, span)}

    needs = "position" if around.version < 3 else "position parentOrientation"
    return _specifier(span, "heading", evaluate, heading, needs=needs)


def bind(node: ast.Specifier, evaluate: Evaluate, around: SpecifierContext) -> BoundSpecifier:
    """The specifier that a syntax node stands for, with its arguments evaluated.

    Args:
        node: The syntax.
        evaluate: Evaluates an argument.
        around: The ego, the workspace and so on.

    Raises:
        ScenarioError: An argument has the wrong type, or the specifier is not supported.
    """
    if isinstance(node, ast.WithSpecifier):
        return _with(node, evaluate(node.value), around)
    values = values_of(node, evaluate, around.ego)
    if node.row.operands[0].name == "reference":
        values[0] = to_common_type(values[0], node.span)
    bound = _bind_each(_MEANINGS[node.row], values, node.span, around)
    return _as_parent(bound) if around.version == 3 and "heading" in bound.optionally else bound


def _as_parent(bound: BoundSpecifier) -> BoundSpecifier:
    """In Scenic 3, what a place says about the heading is the orientation that `yaw` is added to."""

    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        given = bound.evaluate(instance)
        return {("parentOrientation" if name == "heading" else name): value for name, value in given.items()}

    return replace(bound, optionally=bound.optionally - {"heading"} | {"parentOrientation"}, evaluate=evaluate)


def _bind_each(
    meaning: Callable[..., BoundSpecifier], values: list[ModelValue], span: Span, around: SpecifierContext
) -> BoundSpecifier:
    """The specifier for each outcome of a random choice of objects among its arguments, as one."""
    choice = next((value for value in values if holds_instances(value)), None)
    if choice is None:
        return meaning(around, span, *values)
    choice = cast(Choice, choice)
    options = [
        _bind_each(meaning, [option if value is choice else value for value in values], span, around)
        for option in choice.options
    ]
    if any(option.condition for option in options):
        raise fail("unsupported-construct", "this specifier with a random object is not supported", span,
                   "which object is random", ("write the condition with `require`",))  # fmt: skip
    optional = frozenset[str].intersection(*(option.optionally for option in options))

    def chosen(instance: Instance) -> Mapping[str, ModelValue]:
        given = [option.evaluate(instance) for option in options]
        return {name: make_choice(choice.index, [each[name] for each in given], span)
                for name in sorted(options[0].gives | optional)}  # fmt: skip

    needs = frozenset[str]().union(*(option.needs for option in options))
    return BoundSpecifier(options[0].gives, optional, needs, chosen, span)


def _with(node: ast.WithSpecifier, value: ModelValue, around: SpecifierContext) -> BoundSpecifier:
    name = FIRST_NAMES.get(node.property, node.property) if around.version == 1 else node.property
    if leaves_the_plane(name, value):
        raise fail("unsupported-construct", f"`with {name}` is not supported", node.span, "labels are matched in 2D",
                   ("state the heading with `facing`, the size with `width` and `length`",))  # fmt: skip
    own = DEVIATIONS.get(name, name)
    return _specifier(
        node.span, own, lambda instance: {own: deviation(name, _known(value, instance), node.span)}, value
    )


def _at(around: SpecifierContext, span: Span, position: ModelValue) -> BoundSpecifier:
    return _position(span, position)


def _on(around: SpecifierContext, span: Span, region: ModelValue) -> BoundSpecifier:
    is_place = kind_of_model(region) == "vector" or isinstance(region, tuple | list)
    if around.version == 3 and (is_place or (isinstance(region, Instance) and region.index is None)):
        return _position(span, region)
    return _in_region(around, span, region, modifies=around.version == 3)


def _offset_by(around: SpecifierContext, span: Span, by: ModelValue) -> BoundSpecifier:
    ego = around.ego(span)
    position = lift(lambda by: operators.offset(ego, by, span), by)
    return _position(span, position, _inherited(ego, around, span))


def _offset_along(around: SpecifierContext, span: Span, direction: ModelValue, by: ModelValue) -> BoundSpecifier:
    ego = around.ego(span)
    position = lift(lambda way, by: operators.along(ego, way, by, span), direction, by)
    return _position(span, position, _inherited(ego, around, span))


def _in_space(word: str, around: SpecifierContext, span: Span, *operands: ModelValue) -> BoundSpecifier:
    raise fail("unsupported-construct", f"`{word}` is not supported: labels are matched in 2D", span,
               "a place above or below", ("use `at`, `ahead of`, `left of` or their like",))  # fmt: skip


def _using(around: SpecifierContext, span: Span, value: ModelValue) -> BoundSpecifier:
    raise fail("unsupported-construct", "`using` is not supported", span, "places by a function of its own",
               ("write the place with the built-in specifiers",))  # fmt: skip


_MEANINGS: dict[PhraseRow, Callable[..., BoundSpecifier]] = each_meaning(SPECIFIERS, {
    "at {position}": _at,
    "in {region}": _in_region,
    "on {region}": _on,
    "contained in {region}": partial(_in_region, contained=True),
    "offset by {offset}": _offset_by,
    "offset along {direction} by {offset}": _offset_along,
    "beyond {target} by {offset} [from {origin}]": _beyond,
    "visible [from {viewer}]": partial(_visible, False),
    "not visible [from {viewer}]": partial(_visible, True),
    "left of {reference} [by {distance}]": partial(_beside, -1, 0),
    "right of {reference} [by {distance}]": partial(_beside, 1, 0),
    "ahead of {reference} [by {distance}]": partial(_beside, 0, 1),
    "behind {reference} [by {distance}]": partial(_beside, 0, -1),
    "above {reference} [by {distance}]": partial(_in_space, "above"),
    "below {reference} [by {distance}]": partial(_in_space, "below"),
    "following {field} [from {origin}] for {distance}": _following,
    "facing {heading}": _facing,
    "facing toward {target}": partial(_facing_point, False),
    "facing away from {target}": partial(_facing_point, True),
    "facing directly toward {target}": partial(_facing_point, False),
    "facing directly away from {target}": partial(_facing_point, True),
    "apparently facing {heading} [from {origin}]": _apparently,
    "using {value}": _using,
})  # fmt: skip
