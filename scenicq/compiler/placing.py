"""What each specifier of the language means (language paper, appendix B.3; Scenic 3's changes in its 2D mode)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import assert_never, cast

from scenicq.compiler import operators
from scenicq.compiler.coerce import kind_of_model, property_node, to_heading, to_region, to_scalar, to_vector
from scenicq.compiler.specifiers import BoundSpecifier
from scenicq.compiler.values import Delayed, Instance, ModelValue, fail, lift
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import Feature, Node, PointIn, RegionDifference
from scenicq.forest.compute import fold
from scenicq.syntax import ast

__all__ = ["Surroundings", "bind"]

Evaluate = Callable[[ast.Expression], ModelValue]


class Surroundings:
    """What specifiers refer to besides their arguments.

    Attributes:
        version: The version of Scenic.
        ego: Gives the ego, or fails where there is none yet.
        workspace: The workspace's region.
    """

    def __init__(
        self,
        version: int,
        ego: Callable[[Span], Instance],
        workspace: Callable[[], Node],
    ) -> None:
        """Take what the interpreter knows."""
        self.version = version
        self.ego = ego
        self.workspace = workspace


def _specifier(
    span: Span,
    gives: str,
    evaluate: Callable[[Instance], Mapping[str, ModelValue]],
    *arguments: ModelValue,
    optionally: str = "",
    needs: str = "",
) -> BoundSpecifier:
    delayed = frozenset[str]().union(*(argument.needs for argument in arguments if isinstance(argument, Delayed)))
    return BoundSpecifier(
        frozenset(gives.split()), frozenset(optionally.split()), frozenset(needs.split()) | delayed, evaluate, span
    )


def _known(value: ModelValue, instance: Instance) -> ModelValue:
    while isinstance(value, Delayed):
        value = value.evaluate(instance)
    return value


def _position(span: Span, value: ModelValue, heading: ModelValue = None) -> BoundSpecifier:
    """A specifier of a position and, if there is one, optionally of a heading."""

    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        given: dict[str, ModelValue] = {"position": to_vector(_known(value, instance), span)}
        if heading is not None:
            given["heading"] = heading
        return given

    return _specifier(span, "position", evaluate, value, optionally="heading" if heading is not None else "")


def _inherited(origin: ModelValue, around: Surroundings, span: Span) -> ModelValue:
    """The heading that Scenic 3 takes over from an oriented origin; Scenic 1 and 2 take none."""
    if around.version < 3 or not (isinstance(origin, Instance) and origin.oriented):
        return None
    return to_heading(origin, span)


def _own_position(instance: Instance, position: Node, span: Span) -> Node:
    """The position that an optional heading is taken at: by reference for an object, which a label observes."""
    return position if instance.index is None else Feature(instance.index, "position", "vector", span=span)


def _in_region(span: Span, region: ModelValue, *, contained: bool = False) -> BoundSpecifier:
    area = to_region(region, span)
    point = PointIn(area, span=span)
    has_heading = operators.orientation(area, point, span) is not None

    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        given: dict[str, ModelValue] = {"position": point, "regionContainedIn": area}
        if has_heading:
            given["heading"] = operators.orientation(area, _own_position(instance, point, span), span)
        return given

    gives = "position regionContainedIn" if contained else "position"
    return _specifier(span, gives, evaluate, optionally="heading" if has_heading else "")


_SIDES: dict[str, tuple[int, int]] = {"left": (-1, 0), "right": (1, 0), "ahead": (0, 1), "behind": (0, -1)}


def _beside(node: ast.DirectionSpecifier, reference: ModelValue, by: ModelValue) -> BoundSpecifier:
    """`left of X by D` and its like: from the edge of X's box to the edge of the object's own."""
    span = node.span
    if node.direction not in _SIDES:
        raise fail("unsupported-construct", f"`{node.direction}` is not supported: labels are matched in 2D", span,
                   "a place above or below", ("use `at`, `ahead of`, `left of` or their like",))  # fmt: skip
    right, ahead = _SIDES[node.direction]
    size = "width" if right else "length"

    def gap() -> tuple[Node, Node]:
        if kind_of_model(by) == "vector" or isinstance(by, tuple | list):
            pair = to_vector(by, span)
            return build.coordinate(pair, 0, span), build.coordinate(pair, 1, span)
        distance = to_scalar(0.0 if by is None else by, span)
        signed = distance if right + ahead > 0 else cast(Node, operators.negate(distance, span))
        zero = build.constant(0.0)
        return (signed, zero) if right else (zero, signed)

    def half(instance: Instance) -> Node:
        factor = build.constant(0.5 * (right + ahead))
        return build.arithmetic(
            operators.ArithmeticOp.MUL, to_scalar(property_node(instance, size, span), span), factor, span=span
        )

    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        x, y = gap()
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


def _visible(node: ast.VisibleSpecifier | ast.NotVisibleSpecifier, viewer: ModelValue, around: Surroundings) -> BoundSpecifier:
    seen = operators.visible_region(viewer, node.span)
    workspace = around.workspace()
    if isinstance(node, ast.NotVisibleSpecifier):
        return _in_region(node.span, fold(RegionDifference(workspace, seen, span=node.span)))
    return _in_region(node.span, operators.region_intersection(seen, workspace, node.span))


def _beyond(node: ast.BeyondSpecifier, target: ModelValue, by: ModelValue, origin: ModelValue, around: Surroundings) -> BoundSpecifier:
    span = node.span
    goal = to_vector(target, span)
    sight = build.bearing(build.vector_difference(goal, to_vector(origin, span), span), span)
    is_vector = kind_of_model(by) == "vector" or isinstance(by, tuple | list)
    offset = to_vector(by, span) if is_vector else build.vector(build.constant(0.0), to_scalar(by, span), span)
    return _position(span, build.offset_local(goal, sight, offset, span), _inherited(origin, around, span))


def _following(span: Span, end: Instance) -> BoundSpecifier:
    position, direction = end.properties["position"], end.properties["heading"]

    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        here = _own_position(instance, position, span)
        return {"position": position, "heading": operators.direction_at(direction.field, here, span)}

    return _specifier(span, "position", evaluate, optionally="heading")


def _facing(node: ast.FacingSpecifier, value: ModelValue) -> BoundSpecifier:
    span = node.span

    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        heading = _known(value, instance)
        if operators.is_field(heading):
            return {"heading": operators.direction_at(heading, property_node(instance, "position", span), span)}
        return {"heading": to_heading(heading, span)}

    needs = "position" if operators.is_field(value) else ""
    return _specifier(span, "heading", evaluate, value, needs=needs)


def _facing_point(span: Span, target: ModelValue, *, away: bool) -> BoundSpecifier:
    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        own, goal = to_vector(property_node(instance, "position", span), span), to_vector(_known(target, instance), span)
        line = build.vector_difference(own, goal, span) if away else build.vector_difference(goal, own, span)
        return {"heading": build.bearing(line, span)}

    return _specifier(span, "heading", evaluate, target, needs="position")


def _apparently(span: Span, heading: ModelValue, origin: ModelValue) -> BoundSpecifier:
    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        own = to_vector(property_node(instance, "position", span), span)
        line = build.vector_difference(own, to_vector(origin, span), span)
        return {"heading": build.add(to_heading(_known(heading, instance), span), build.bearing(line, span), span)}

    return _specifier(span, "heading", evaluate, heading, needs="position")


def bind(node: ast.Specifier, evaluate: Evaluate, around: Surroundings) -> BoundSpecifier:  # noqa: PLR0911, PLR0912
    """The specifier that a syntax node stands for, with its arguments evaluated.

    Args:
        node: The syntax.
        evaluate: Evaluates an argument.
        around: The ego, the workspace and so on.

    Raises:
        ScenarioError: An argument has the wrong type, or the specifier is not supported.
    """
    span = node.span

    def origin(expression: ast.Expression | None) -> ModelValue:
        return around.ego(span) if expression is None else evaluate(expression)

    match node:
        case ast.WithSpecifier():
            value = evaluate(node.value)
            name = "length" if node.property == "height" and around.version == 1 else node.property
            return _specifier(span, name, lambda instance: {name: _known(value, instance)}, value)
        case ast.AtSpecifier():
            return _position(span, evaluate(node.position))
        case ast.OnSpecifier():
            region = evaluate(node.region)
            if around.version == 3 and kind_of_model(region) == "vector":
                return _position(span, region)
            return _in_region(span, region)
        case ast.InSpecifier():
            return _in_region(span, evaluate(node.region))
        case ast.ContainedInSpecifier():
            return _in_region(span, evaluate(node.region), contained=True)
        case ast.OffsetBySpecifier():
            ego = around.ego(span)
            position = lift(lambda by: operators.offset(ego, by, span), evaluate(node.offset))
            return _position(span, position, _inherited(ego, around, span))
        case ast.OffsetAlongSpecifier():
            ego = around.ego(span)
            position = lift(
                lambda way, by: operators.along(ego, way, by, span), evaluate(node.direction), evaluate(node.offset)
            )
            return _position(span, position, _inherited(ego, around, span))
        case ast.BeyondSpecifier():
            return _beyond(node, evaluate(node.target), evaluate(node.offset), origin(node.origin), around)
        case ast.VisibleSpecifier() | ast.NotVisibleSpecifier():
            return _visible(node, origin(node.viewer), around)
        case ast.DirectionSpecifier():
            by = None if node.distance is None else evaluate(node.distance)
            return _beside(node, evaluate(node.reference), by)
        case ast.FollowingSpecifier():
            end = operators.follow(evaluate(node.field), origin(node.origin), evaluate(node.distance), span)
            return _following(span, end)
        case ast.FacingSpecifier():
            return _facing(node, evaluate(node.heading))
        case ast.FacingTowardSpecifier():
            return _facing_point(span, evaluate(node.target), away=False)
        case ast.FacingAwayFromSpecifier():
            return _facing_point(span, evaluate(node.target), away=True)
        case ast.ApparentlyFacingSpecifier():
            return _apparently(span, evaluate(node.heading), origin(node.origin))
        case ast.UsingSpecifier():
            raise fail("unsupported-construct", "`using` is not supported", span, "places by a function of its own",
                       ("write the place with the built-in specifiers",))  # fmt: skip
        case _:
            assert_never(node)
