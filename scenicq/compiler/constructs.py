"""Scenic's own expressions: which operator each stands for, over evaluated operands (language paper, figure 9).

Programs may also call operators as functions, by the names that Scenic's compiler gives them.
"""

# Programs are dynamically typed: their values are `Any`, and so is what lambdas take.
# pyright: reportUnknownLambdaType=false, reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownParameterType=false, reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from scenicq.compiler import operators
from scenicq.compiler.attributes import PARTS, part_of
from scenicq.compiler.choices import distribute
from scenicq.compiler.coerce import to_vector
from scenicq.compiler.environment import Environment
from scenicq.compiler.following import follow
from scenicq.compiler.values import Builtin, ModelValue, fail, lift
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.syntax import ast

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["construct", "operator_functions"]


class _Operation(NamedTuple):
    """An operator over evaluated operands.

    Attributes:
        operands: Names of the operands in the node, in the order of the meaning; one that is left out is the ego.
        meaning: Takes the interpreter, the operands and the span.
        look_ups: How many look-ups on the map it takes at most.
        is_spread: Whether it applies to every outcome of random choices of objects.
    """

    operands: str
    meaning: Callable[..., ModelValue]
    look_ups: int = 0
    is_spread: bool = True


def _pure(function: Callable[..., ModelValue]) -> Callable[..., ModelValue]:
    """The meaning of an operator that asks nothing of the interpreter."""
    return lambda run, *values: function(*values)


def _relative_position(target: ModelValue, origin: ModelValue, span: Span) -> ModelValue:
    return build.vector_difference(to_vector(target, span), to_vector(origin, span), span)


def _implies(left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    return operators.combine("or", [operators.combine("not", [left], span), right], span)


def _sight(combine: Callable[..., ModelValue]) -> _Operation:
    def part(run: Interpreter, region: ModelValue, viewer: ModelValue, span: Span) -> ModelValue:
        return combine(operators.existing(region, span), operators.visible_region(viewer, span), span)

    return _Operation("region viewer", part)


def _part(name: str) -> _Operation:
    return _Operation("target", lambda run, target, span: part_of(name, target, span))


_OPERATIONS: dict[type, _Operation] = {
    ast.Deg: _Operation("value", _pure(operators.degrees), is_spread=False),
    ast.VectorOperator: _Operation("x y", lambda run, x, y, span: to_vector((x, y), span), is_spread=False),
    ast.FieldAt: _Operation("field position", _pure(operators.direction_at), look_ups=1),
    ast.RelativeTo: _Operation("left right", _pure(operators.relative_to)),
    ast.OffsetBy: _Operation("origin offset", _pure(operators.offset)),
    ast.OffsetAlong: _Operation("origin direction offset", _pure(operators.along)),
    ast.Follow: _Operation("field origin distance", follow, look_ups=100),
    ast.RelativePosition: _Operation("target origin", _pure(_relative_position)),
    ast.RelativeHeading: _Operation("target origin", _pure(operators.relative_heading)),
    ast.ApparentHeading: _Operation("target origin", _pure(operators.apparent_heading)),
    ast.DistanceOperator: _Operation("target origin", _pure(operators.distance_to), look_ups=1),
    ast.DistancePast: _Operation("target origin", _pure(operators.distance_past)),
    ast.Angle: _Operation("target origin", _pure(operators.angle_to)),
    ast.CanSee: _Operation("viewer target", _pure(operators.can_see)),
    ast.IntersectsOperator: _Operation("left right", _pure(operators.intersects)),
    ast.Implies: _Operation("left right", _pure(_implies), is_spread=False),
}
_SEEN, _UNSEEN = _sight(operators.region_intersection), _sight(operators.region_difference)
_BY_NAME: dict[str, type] = {
    "FieldAt": ast.FieldAt, "RelativeTo": ast.RelativeTo, "OffsetAlong": ast.OffsetAlong, "Follow": ast.Follow,
    "RelativePosition": ast.RelativePosition, "RelativeHeading": ast.RelativeHeading,
    "ApparentHeading": ast.ApparentHeading, "DistanceFrom": ast.DistanceOperator, "DistancePast": ast.DistancePast,
    "CanSee": ast.CanSee, "Intersects": ast.IntersectsOperator, "Implies": ast.Implies,
}  # fmt: skip
"""Functions that take the operands of an operator as they stand there."""
_FUNCTIONS: dict[str, tuple[_Operation, str]] = {
    **{name: (_OPERATIONS[node], _OPERATIONS[node].operands) for name, node in _BY_NAME.items()},
    "AngleTo": (_OPERATIONS[ast.Angle], "target"),
    "AngleFrom": (_OPERATIONS[ast.Angle], "origin target"),
    "Visible": (_SEEN, "region"),
    "NotVisible": (_UNSEEN, "region"),
    "VisibleFromOp": (_SEEN, "region viewer"),
    "NotVisibleFromOp": (_UNSEEN, "region viewer"),
    **{part.title().replace(" ", ""): (_part(part), "target") for part in PARTS},
}
"""Operators by the names of their functions, and the operands that a function takes in its order."""


def _apply(run: Interpreter, operation: _Operation, operands: Sequence[ModelValue], span: Span) -> ModelValue:
    """Apply an operator as soon as its operands are known."""
    run.budget.step(span, operation.look_ups * run.budget.LOOK_UP_STEPS)

    def now(*values: ModelValue) -> ModelValue:
        return operation.meaning(run, *values, span)

    return lift(lambda *values: distribute(now, values, span) if operation.is_spread else now(*values), *operands)


def operator_functions(run: Interpreter) -> dict[str, ModelValue]:
    """The functions that programs may call in place of operators."""

    def function(name: str, operation: _Operation, parameters: list[str]) -> Builtin:
        def call(span: Span, *given: ModelValue) -> ModelValue:
            values = dict(zip(parameters, given, strict=False))
            missing = set(operation.operands.split()) - set(values)
            if len(given) > len(parameters) or missing - {"origin", "viewer"}:
                raise TypeError(f"{name}() takes {', '.join(parameters)}")
            operands = [values[each] if each in values else run.ego(span) for each in operation.operands.split()]
            return _apply(run, operation, operands, span)

        return Builtin(name, call, lifted=False)

    return {name: function(name, operation, taken.split()) for name, (operation, taken) in _FUNCTIONS.items()}


def construct(
    run: Interpreter, node: ast.Expression, scope: Environment, value: Callable[[ast.Expression], ModelValue]
) -> ModelValue:
    """The value of an expression that Python does not have.

    Args:
        run: The interpreter.
        node: The expression.
        scope: The names it sees.
        value: Evaluates an operand.

    Raises:
        ScenarioError: Whatever is wrong with it.
    """
    span = node.span
    match node:
        case ast.New():
            return run.make_instance(node, scope)
        case ast.PartOf():
            operation = _part(node.part)
        case ast.Visible() | ast.VisibleFrom():
            operation = _UNSEEN if node.negated else _SEEN
        case ast.InitialScenario():
            # the scene that is matched is the initial one
            run.dynamic("initial scenario", span)
            return True
        case ast.Temporal() | ast.UntilOperator():
            raise fail("unsupported-construct", f"`{span.text}` is not supported", span,
                       "does not describe one instant",
                       ("a scene is matched at one instant: state what holds then",))  # fmt: skip
        case _ if type(node) in _OPERATIONS:
            operation = _OPERATIONS[type(node)]
        case _:
            raise fail("unsupported-construct", f"`{span.text}` is not supported", span, "labels are matched in 2D",
                       ("use what has a meaning in the plane",))  # fmt: skip
    parts: list[ast.Expression | None] = [getattr(node, name, None) for name in operation.operands.split()]
    return _apply(run, operation, [run.ego(span) if part is None else value(part) for part in parts], span)
