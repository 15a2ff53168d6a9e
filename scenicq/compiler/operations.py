"""Scenic's own expressions: which operator each stands for, over evaluated operands (language paper, figure 9).

Programs may also call operators as functions, by the names that Scenic's compiler gives them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from scenicq.compiler import operators
from scenicq.compiler.attributes import PARTS, part_of
from scenicq.compiler.coerce import to_vector
from scenicq.compiler.following import follow
from scenicq.compiler.measures import between_boxes
from scenicq.compiler.random_values import holds_instances, lift
from scenicq.compiler.values import Builtin, ModelValue, fail
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.syntax import ast
from scenicq.syntax.phrases import BOX_PARTS, OPERATORS, PhraseRow, each_meaning

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["operator_functions", "phrase", "values_of"]


class _Operation(NamedTuple):
    """What an operator means.

    Attributes:
        meaning: Takes the values of the operands and the span.
        look_ups: How many look-ups on the map it takes at most.
        is_spread: Whether it applies to every outcome of random choices of objects.
        takes_run: Whether the meaning takes the interpreter first.
    """

    meaning: Callable[..., ModelValue]
    look_ups: int = 0
    is_spread: bool = True
    takes_run: bool = False


class _Refusal(NamedTuple):
    """Why an operator means nothing here, and what to write."""

    label: str
    hint: str


def _relative_position(target: ModelValue, origin: ModelValue, span: Span) -> ModelValue:
    return build.vector_difference(to_vector(target, span), to_vector(origin, span), span)


def _implies(left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    return operators.combine("or", [operators.combine("not", [left], span), right], span)


def _sight(combine: Callable[..., ModelValue], region: ModelValue, viewer: ModelValue, span: Span) -> ModelValue:
    return combine(operators.existing(region, span), operators.visible_region(viewer, span), span)


def _by_ego(sight: Callable[..., ModelValue], run: Interpreter, region: ModelValue, span: Span) -> ModelValue:
    return sight(region, run.ego(span), span)


def _box_distance(one: ModelValue, other: ModelValue, span: Span) -> ModelValue:
    return between_boxes(one, other, span, "minimum distance")


def _initial(run: Interpreter, span: Span) -> ModelValue:
    # but for scenarios that others run, the scene that is matched is the initial one
    run.dynamic("initial scenario", span)
    return run.is_initial


_SEEN, _UNSEEN = (partial(_sight, each) for each in (operators.region_intersection, operators.region_difference))
_DISTANCE = _Operation(operators.distance_to, look_ups=1)
_ANGLE = _Operation(operators.angle_to)
_FROM = _Operation(lambda origin, target, span: operators.distance_to(target, origin, span), look_ups=1)
_ANGLE_FROM = _Operation(lambda origin, target, span: operators.angle_to(target, origin, span))
_OVER_TIME = _Refusal("does not describe one instant", "a scene is matched at one instant: state what holds then")
_IN_SPACE = _Refusal("labels are matched in 2D", "use what has a meaning in the plane")
_OPERATIONS: dict[PhraseRow, _Operation | _Refusal] = each_meaning(OPERATORS, {
    "{left} until {right}": _OVER_TIME,
    "{left} implies {right}": _Operation(_implies, is_spread=False),
    "always {condition}": _OVER_TIME,
    "eventually {condition}": _OVER_TIME,
    "next {condition}": _OVER_TIME,
    "{region} visible from {viewer}": _Operation(_SEEN),
    "{region} not visible from {viewer}": _Operation(_UNSEEN),
    "{viewer} can see {target}": _Operation(operators.can_see),
    "{left} intersects {right}": _Operation(operators.intersects),
    "{origin} offset along {direction} by {offset}": _Operation(operators.along),
    "{origin} offset by {offset}": _Operation(operators.offset),
    "{left} relative to {right}": _Operation(operators.relative_to),
    "{field} at {position}": _Operation(operators.direction_at, look_ups=1),
    "relative position of {target} [from {origin}]": _Operation(_relative_position),
    "relative heading of {target} [from {origin}]": _Operation(operators.relative_heading),
    "apparent heading of {target} [from {origin}]": _Operation(operators.apparent_heading),
    "distance to {target} [from {origin}]": _DISTANCE,
    "distance from {origin} [to {target}]": _FROM,
    "minimum distance to {target} [from {origin}]": _Operation(_box_distance),
    "minimum distance from {origin} [to {target}]": _Operation(_box_distance),
    "distance past {target} [of {origin}]": _Operation(operators.distance_past),
    "angle to {target} [from {origin}]": _ANGLE,
    "angle from {origin} [to {target}]": _ANGLE_FROM,
    "azimuth to {target} [from {origin}]": _ANGLE,
    "azimuth from {origin} [to {target}]": _ANGLE_FROM,
    "altitude to {target} [from {origin}]": _IN_SPACE,
    "altitude from {origin} [to {target}]": _IN_SPACE,
    "follow {field} [from {origin}] for {distance}": _Operation(follow, look_ups=100, takes_run=True),
    "visible {region}": _Operation(partial(_by_ego, _SEEN), takes_run=True),
    "not visible {region}": _Operation(partial(_by_ego, _UNSEEN), takes_run=True),
    **{f"{part} of {{target}}": _Operation(partial(part_of, part)) for part in BOX_PARTS},
    "{x} @ {y}": _Operation(lambda x, y, span: to_vector((x, y), span), is_spread=False),
    "{value} deg": _Operation(operators.degrees, is_spread=False),
    "initial scenario": _Operation(_initial, takes_run=True),
})  # fmt: skip
_FUNCTIONS: dict[str, str] = {
    "FieldAt": "{field} at {position}",
    "RelativeTo": "{left} relative to {right}",
    "OffsetAlong": "{origin} offset along {direction} by {offset}",
    "Follow": "follow {field} [from {origin}] for {distance}",
    "RelativePosition": "relative position of {target} [from {origin}]",
    "RelativeHeading": "relative heading of {target} [from {origin}]",
    "ApparentHeading": "apparent heading of {target} [from {origin}]",
    "DistanceFrom": "distance to {target} [from {origin}]",
    "DistancePast": "distance past {target} [of {origin}]",
    "AngleTo": "angle to {target} [from {origin}]",
    "AngleFrom": "angle from {origin} [to {target}]",
    "CanSee": "{viewer} can see {target}",
    "Intersects": "{left} intersects {right}",
    "Implies": "{left} implies {right}",
    "Visible": "visible {region}",
    "NotVisible": "not visible {region}",
    "VisibleFromOp": "{region} visible from {viewer}",
    "NotVisibleFromOp": "{region} not visible from {viewer}",
    **{part.title().replace(" ", ""): f"{part} of {{target}}" for part in PARTS},
}
"""Operators by the names of their functions, which take the operands in the order of the text."""
_ARGUMENTS = {"AngleTo": 1, "AngleFrom": 2}
"""How many arguments those take that take not all operands, or must have all."""


def _apply(run: Interpreter, operation: _Operation, operands: Sequence[ModelValue], span: Span) -> ModelValue:
    """Apply an operator as soon as its operands are known."""
    run.budget.step(span, operation.look_ups * run.budget.LOOK_UP_STEPS)

    def now(*values: ModelValue) -> ModelValue:
        return operation.meaning(*((run,) if operation.takes_run else ()), *values, span)

    return lift(now, *operands, span=span, spread=holds_instances if operation.is_spread else None)


def operator_functions(run: Interpreter) -> dict[str, ModelValue]:
    """The functions that programs may call in place of operators."""
    rows = {row.text: row for row in OPERATORS}

    def function(name: str, row: PhraseRow) -> Builtin:
        def call(span: Span, *given: ModelValue) -> ModelValue:
            operands = row.operands[: _ARGUMENTS.get(name)]
            left_out = operands[len(given) :]
            if len(given) > len(operands) or not all(each.is_ego and name not in _ARGUMENTS for each in left_out):
                raise TypeError(f"{name}() takes {', '.join(each.name for each in operands)}")
            values = [*given, *(run.ego(span) for _ in row.operands[len(given) :])]
            operation = _OPERATIONS[row]
            assert isinstance(operation, _Operation)
            return _apply(run, operation, values, span)

        return Builtin(name, call, lifted=False)

    return {name: function(name, rows[text]) for name, text in _FUNCTIONS.items()}


def phrase(run: Interpreter, node: ast.Phrase, value: Callable[[ast.Expression], ModelValue]) -> ModelValue:
    """The value of an expression that is a phrase.

    Args:
        run: The interpreter.
        node: The expression.
        value: Evaluates an operand.

    Raises:
        ScenarioError: Whatever is wrong with it.
    """
    span, operation = node.span, _OPERATIONS[node.row]
    if isinstance(operation, _Refusal):
        message = f"`{span.text}` is not supported"
        raise fail("unsupported-construct", message, span, operation.label, (operation.hint,))
    return _apply(run, operation, values_of(node, value, run.ego), span)


def values_of(
    node: ast.Phrase, value: Callable[[ast.Expression], ModelValue], ego: Callable[[Span], ModelValue]
) -> list[ModelValue]:
    """The values of a phrase's operands; of one that is left out the ego, or None where that is not meant.

    Args:
        node: The phrase.
        value: Evaluates an operand.
        ego: Gives the ego.
    """
    places = zip(node.row.operands, node.operands, strict=True)
    return [value(part) if part is not None else ego(node.span) if place.is_ego else None for place, part in places]
